#include "tests/digests/inputs.h"

#include <cmath>
#include <limits>
#include <utility>

#include "core/mesh/deform.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::digests {
namespace {

using test::Random;

constexpr std::size_t kLooseRays = 400, kBundles = 3, kBundleRays = 48, kPoints = 60;

/// By a quaternion of small integers, so without sines.
Mat3d rotation(Random& random) {
  const auto integer = [&] { return double(random.below(17)) - 8.0; };
  const double w = 1.0 + double(random.below(8)), x = integer(), y = integer(), z = integer();
  const double s = 2.0 / (w * w + x * x + y * y + z * z);
  return {Vec3d{1.0 - s * (y * y + z * z), s * (x * y + w * z), s * (x * z - w * y)},
          Vec3d{s * (x * y - w * z), 1.0 - s * (x * x + z * z), s * (y * z + w * x)},
          Vec3d{s * (x * z + w * y), s * (y * z - w * x), 1.0 - s * (x * x + y * y)}};
}

/// Rotated, scaled by axis, a third of them mirrored, a third sheared.
Affine any_affine(Random& random, const Vec3d& center, double spread, double size) {
  Mat3d linear = rotation(random);
  if (random.below(3) == 0) linear[1] += random.uniform(-1.0, 1.0) * linear[0];
  if (random.below(3) == 0) linear[0] = -linear[0];
  for (int axis = 0; axis < 3; ++axis) linear[axis] *= size * random.uniform(0.3, 2.0);
  return {linear, center + random.in_box(spread)};
}

void add_mesh(Input& input, test::TriangleMesh mesh) {
  const auto count = std::uint32_t(mesh.triangle_count());
  const auto materials = std::uint32_t(input.data.materials.size());
  // Two parts, so that every mesh has two materials.
  mesh.parts = {{0, count / 2, std::uint32_t(input.data.meshes.size()) % materials},
                {count / 2, count - count / 2, std::uint32_t(input.data.meshes.size() + 1) % materials}};
  input.data.meshes.push_back(test::share(std::move(mesh)));
  input.data.deformations.emplace_back();
}

void place(Input& input, std::uint32_t mesh_id, const Affine& where) {
  input.data.instances.push_back({{}, where, mesh_id});
}

/// Matt, mirroring and glassy surfaces under a sun and a lamp.
Input named(std::string name) {
  Input input;
  input.name = std::move(name);
  scene::Material matt, mirror, glass;
  matt.base_color = {0.7F, 0.4F, 0.2F, 1.F};
  matt.metallic = 0.F;
  mirror.roughness = 0.05F;
  glass.metallic = 0.F;
  glass.roughness = 0.1F;
  glass.transmission = 0.8F;
  input.data.materials = {matt, mirror, glass};
  scene::Light sun, lamp;
  sun.direction = {-0.48, -0.64, -0.6};
  sun.intensity = 3.0;
  lamp.kind = scene::LightKind::kPoint;
  lamp.position = {2.0, 7.0, 3.0};
  lamp.intensity = 40.0;
  lamp.range = 50.0;
  input.data.lights = {sun, lamp};
  return input;
}

std::array<Vec3d, 3> world_corners(const scene::SceneData& data, const PrimitiveRef& triangle) {
  const scene::InstanceData& instance = data.instances[triangle.instance_id];
  const auto corners = data.meshes[instance.mesh_id]->corners(triangle.primitive_id);
  std::array<Vec3d, 3> world;
  for (std::size_t i = 0; i < 3; ++i) world[i] = instance.world_from_object.point(Vec3d(corners[i]));
  return world;
}

PrimitiveRef any_triangle(const scene::SceneData& data, Random& random) {
  const std::uint32_t instance = random.below(std::uint32_t(data.instances.size()));
  const auto& mesh = *data.meshes[data.instances[instance].mesh_id];
  return {instance, random.below(std::uint32_t(mesh.triangle_count()))};
}

/// A vertex, a point of an edge or one inside.
Vec3d point_on(const scene::SceneData& data, const PrimitiveRef& triangle, Random& random) {
  const auto [a, b, c] = world_corners(data, triangle);
  double u = random.uniform(), v = random.uniform() * (1.0 - u);
  const std::uint32_t kind = random.below(3);
  if (kind == 0) v = 0.0;
  if (kind == 1) u = v = 0.0;
  return (1.0 - u - v) * a + u * b + v * c;
}

Ray ray_to(const Vec3d& target, double size, Random& random) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Ray ray;
  // One draw a statement: compilers evaluate the sides of a product in the order that they like.
  const double away = random.below(3) == 0 ? 0.1 : 2.0;
  ray.origin = target + away * size * random.in_box(1.0);
  ray.direction = target - ray.origin;
  const int axis = int(random.below(3));
  switch (random.below(12)) {
    case 0:  // along an axis
      ray.origin = target;
      ray.origin[axis] += size;
      ray.direction = Vec3d(0.0);
      ray.direction[axis] = -size;
      break;
    case 1:  // across it
      ray.origin[axis] = target[axis];
      ray.direction[axis] = 0.0;
      break;
    case 2:
      ray.direction *= std::ldexp(1.0, int(random.below(80)) - 40);
      break;
    case 3:
      ray.direction = random.below(2) == 0 ? Vec3d(0.0) : Vec3d(std::nan(""));  // invalid
      break;
    default:
      break;
  }
  // The target lies at t = 1, unless the direction has another length by now.
  switch (random.below(8)) {
    case 0:
      ray.tfar = 1.0;
      break;
    case 1:
      ray.tnear = 1.0;
      break;
    case 2:
      ray.tnear = random.uniform(-2.0, 1.0);
      ray.tfar = ray.tnear + random.uniform(0.0, 2.0);
      break;
    default:
      ray.tfar = kInfinity;
      break;
  }
  return ray;
}

void add_rays(Input& input, Random& random) {
  const double size = max_abs(input.bounds.extent());
  for (std::size_t i = 0; i < kLooseRays; ++i) {
    const PrimitiveRef triangle = any_triangle(input.data, random);
    input.rays.push_back(ray_to(point_on(input.data, triangle, random), size, random));
    input.excluded.push_back(i % 8 == 5 ? triangle : PrimitiveRef{});
  }
  for (std::size_t bundle = 0; bundle < kBundles; ++bundle) {
    const Vec3d eye = input.bounds.center() + 2.0 * size * random.direction();
    const Vec3d target = point_on(input.data, any_triangle(input.data, random), random);
    for (std::size_t i = 0; i < kBundleRays; ++i) {
      const Vec3d direction = target + 0.03 * size * random.in_box(1.0) - eye;
      input.rays.push_back({eye, direction});
      input.excluded.emplace_back();
    }
  }
}

void add_points(Input& input, Random& random) {
  for (std::size_t i = 0; i < kPoints; ++i) {
    const Vec3d on = point_on(input.data, any_triangle(input.data, random), random);
    const Vec3d off = input.bounds.center() + 0.6 * input.bounds.extent() * random.in_box(1.0);
    input.points.push_back(i % 3 == 0 ? on : off);
  }
}

/// Every vertex follows two joints by its place and a target that turns its coordinates, around the middle of
/// the mesh, so that it stays where the rays are.
void add_deformed(Input& input, Random& random) {
  const Affine joints[2] = {any_affine(random, Vec3d(0.1), 0.1, 0.9),
                            any_affine(random, Vec3d(0.0), 0.2, 1.1)};
  const std::vector<double> weights{0.35};
  for (const auto& mesh : input.data.meshes) {
    const Vec3f middle = mesh->bounds().center();
    const Affine there{Mat3d(1.0), Vec3d(middle)}, back{Mat3d(1.0), -Vec3d(middle)};
    mesh::MeshDeformation deformation;
    deformation.influences = 4;
    deformation.morph_targets.resize(1);
    for (const Vec3f& position : mesh->positions) {
      const Vec3f p = position - middle;
      const float share = 1.F / (1.F + p.x * p.x);
      deformation.joints.insert(deformation.joints.end(), {0, 1, 0, 0});
      deformation.weights.insert(deformation.weights.end(), {1.F - share, share, 0.F, 0.F});
      deformation.morph_targets[0].positions.push_back(0.3F * Vec3f(p.y, p.z, p.x));
    }
    const std::vector<Affine> placed{there * joints[0] * back, there * joints[1] * back};
    input.deformed.push_back(mesh::deform(*mesh, deformation, weights, placed).positions);
  }
}

Input finished(Input input, std::uint64_t seed) {
  Random random(seed);
  for (std::uint32_t id = 0; id < input.data.instances.size(); ++id) {
    const scene::InstanceData& instance = input.data.instances[id];
    for (const Vec3f& p : input.data.meshes[instance.mesh_id]->positions)
      input.bounds.extend(instance.world_from_object.point(Vec3d(p)));
  }
  add_rays(input, random);
  add_points(input, random);
  add_deformed(input, random);
  return input;
}

/// One smooth closed mesh with normals, in its place.
Input ball() {
  Input input = named("ball");
  test::TriangleMesh mesh = test::jittered_icosphere(3, 1);
  for (const Vec3f& p : mesh.positions) mesh.normals.push_back(glm::normalize(p));
  add_mesh(input, std::move(mesh));
  place(input, 0, {});
  return finished(std::move(input), 11);
}

/// Edges of four faces and vertices of many, turned.
Input voxels() {
  Input input = named("voxels");
  Random random(2);
  add_mesh(input, test::voxel_boundary(5, 2));
  place(input, 0, any_affine(random, Vec3d(0.0), 1.0, 1.0));
  return finished(std::move(input), 12);
}

/// Walls in the planes that a tree splits at.
Input city() {
  Input input = named("city");
  add_mesh(input, test::box_city(6, 3));
  place(input, 0, {});
  return finished(std::move(input), 13);
}

/// Needles, triangles without area, and each of them twice.
Input needles() {
  Input input = named("needles");
  test::TriangleMesh mesh = test::slivers(200, 4, 1e5F);
  const test::TriangleMesh more = test::soup(200, 5, 0.4F);
  const auto first = std::uint32_t(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), more.positions.begin(), more.positions.end());
  for (const auto& [a, b, c] : more.triangles) {
    mesh.triangles.push_back({a + first, b + first, c + first});
    if (a % 5 == 0) mesh.triangles.push_back({a, b, b});
  }
  add_mesh(input, test::repeated(mesh, 2));
  place(input, 0, {});
  return finished(std::move(input), 14);
}

/// Instances of four meshes, `apart` from the origin: enough of them for a grid.
Input crowd(std::string name, const Vec3d& apart, std::uint64_t seed) {
  Input input = named(std::move(name));
  Random random(seed);
  add_mesh(input, test::jittered_icosphere(2, 6));
  add_mesh(input, test::box({-1, -1, -1}, {1, 1, 1}));
  add_mesh(input, test::soup(80, 7, 0.5F));
  add_mesh(input, test::voxel_boundary(3, 8));
  for (std::uint32_t i = 0; i < 60; ++i) place(input, i % 4, any_affine(random, apart, 6.0, 0.6));
  // Two that coincide.
  place(input, 1, {Mat3d(0.5), apart});
  place(input, 1, {Mat3d(0.5), apart});
  return finished(std::move(input), seed + 10);
}

/// Coordinates that leave the floats few digits.
Input offset() {
  Input input = named("offset");
  add_mesh(input, test::translated(test::jittered_icosphere(2, 9), {1e4F, -2e4F, 3e3F}));
  place(input, 0, {Mat3d(1.0), Vec3d(-1e4, 2e4, 0.0)});
  return finished(std::move(input), 17);
}

}  // namespace

std::vector<Input> all_inputs() {
  return {ball(),
          voxels(),
          city(),
          needles(),
          crowd("crowd", Vec3d(0.0), 5),
          crowd("far_crowd", Vec3d(3e6, -1e6, 2e5), 6),
          offset()};
}

}  // namespace gridcast::digests
