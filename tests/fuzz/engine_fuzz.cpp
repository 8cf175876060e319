// The engine against the exact reference: a small scene and a few rays out of the bytes.

#include <bit>
#include <limits>
#include <optional>
#include <vector>

#include "core/scene/hit_error.h"
#include "core/scene/trace.h"
#include "tests/fuzz/fuzz_input.h"
#include "tests/support/exact_reference.h"

using namespace gridcast;

namespace {

constexpr blas::StructureKind kStructures[] = {blas::StructureKind::kBruteForce, blas::StructureKind::kBvh,
                                               blas::StructureKind::kWideBvh, blas::StructureKind::kKdTree,
                                               blas::StructureKind::kCompactBvh};

std::shared_ptr<const mesh::TriangleMesh> read_mesh(fuzz::FuzzInput& input) {
  auto mesh = std::make_shared<mesh::TriangleMesh>();
  const std::uint32_t vertices = 3 + input.below(12), triangles = 1 + input.below(16);
  for (std::uint32_t i = 0; i < vertices; ++i) mesh->positions.push_back(input.point());
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const std::uint32_t a = input.below(vertices), b = input.below(vertices), c = input.below(vertices);
    mesh->triangles.push_back({a, b, c});
  }
  return mesh;
}

/// Nothing when the bytes are no scene that an update would accept.
std::optional<scene::SceneData> read_scene(fuzz::FuzzInput& input) {
  scene::SceneData data;
  const std::uint32_t meshes = 1 + input.below(2), instances = 1 + input.below(4);
  for (std::uint32_t i = 0; i < meshes; ++i) {
    data.meshes.push_back(read_mesh(input));
    if (!mesh::validate(*data.meshes.back())) return std::nullopt;
  }
  data.deformations.resize(meshes);
  for (std::uint32_t i = 0; i < instances; ++i) {
    const std::uint32_t mesh_id = input.below(meshes);
    data.instances.push_back({{}, input.affine(), mesh_id});
    if (!InstanceTransform(data.instances.back().world_from_object).active()) return std::nullopt;
  }
  return data;
}

Ray read_ray(fuzz::FuzzInput& input) {
  Ray ray{input.vector(), input.vector()};
  const std::uint32_t ends = input.below(4);
  if ((ends & 1) != 0) ray.tnear = input.number();
  if ((ends & 2) != 0) ray.tfar = input.number();
  return ray;
}

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

bool same(const SurfaceHit& a, const SurfaceHit& b) {
  return a.status == b.status && same_bits(a.t, b.t) && same_bits(a.u, b.u) && same_bits(a.v, b.v) &&
         a.instance_id == b.instance_id && a.primitive_id == b.primitive_id;
}

/// Every structure gives the same bits, and any hit says what closest says.
SurfaceHit ask_all(const std::vector<std::shared_ptr<const scene::Scene>>& scenes, const Ray& ray,
                   Precision precision) {
  const SurfaceHit first = scene::intersect(*scenes.front(), ray, precision);
  for (const auto& scene : scenes) {
    fuzz::require(same(scene::intersect(*scene, ray, precision), first), "structures disagree");
    fuzz::require(scene::occluded(*scene, ray, precision) == first.status, "any and closest hit disagree");
  }
  return first;
}

void check_exact(const scene::Scene& scene, const test::ExactScene& reference, const Ray& ray,
                 const SurfaceHit& hit) {
  const auto expected = reference->closest(ray);
  fuzz::require((hit.status == RayStatus::kHit) == expected.has_value(), "hit and miss are confused");
  if (!expected) return;
  fuzz::require(PrimitiveRef{hit.instance_id, hit.primitive_id} == expected->primitive,
                "another triangle is closest");
  const double bound = scene::t_error(scene, ray, hit);
  if (!std::isfinite(bound)) return;
  const double infinity = std::numeric_limits<double>::infinity();
  fuzz::require(compare(expected->at.t, std::nextafter(hit.t - bound, -infinity)) >= 0 &&
                    compare(expected->at.t, std::nextafter(hit.t + bound, infinity)) <= 0,
                "t_error does not cover t");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::FuzzInput input(data, size);
  const auto scene_data = read_scene(input);
  if (!scene_data) return 0;
  const test::ExactScene reference(*scene_data);
  std::vector<std::shared_ptr<const scene::Scene>> scenes;
  for (const blas::StructureKind kind : kStructures) {
    scene::SceneBuildOptions options;
    options.blas.kind = kind;
    scenes.push_back(scene::build_scene(*scene_data, options).value());
  }
  for (int i = 0; i < 4; ++i) {
    const Ray ray = read_ray(input);
    if (!is_valid(ray)) continue;
    (void)ask_all(scenes, ray, Precision::kRobust);
    check_exact(*scenes.front(), reference, ray, ask_all(scenes, ray, Precision::kExact));
  }
  return 0;
}
