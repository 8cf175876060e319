#pragma once
// The structures, meshes and rays that every structure's tests run over.

#include <cmath>
#include <string>
#include <vector>

#include "core/blas/blas.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::blas {

using mesh::TriangleMesh;
using test::Random;

/// A structure under test. A new kind is one more line of structure_cases().
struct StructureCase {
  std::string name;
  BuildOptions options;
};
inline std::vector<StructureCase> structure_cases() {
  return {
      {"auto", {StructureKind::kAuto}},
      {"bvh_midpoint", {StructureKind::kBvh, BvhSplit::kMidpoint}},
      {"bvh_median", {StructureKind::kBvh, BvhSplit::kMedian}},
      {"bvh_sah", {StructureKind::kBvh, BvhSplit::kBinnedSah}},
      {"wide_bvh", {StructureKind::kWideBvh}},
      {"wide_bvh_whole", {.kind = StructureKind::kWideBvh, .spatial = SpatialSplits::kNever}},
      {"wide_bvh_fast", {.kind = StructureKind::kWideBvh, .quality = BuildQuality::kFast}},
      {"compact_bvh", {StructureKind::kCompactBvh}},
      {"compact_bvh_whole", {.kind = StructureKind::kCompactBvh, .spatial = SpatialSplits::kNever}},
      {"compact_bvh_fast", {.kind = StructureKind::kCompactBvh, .quality = BuildQuality::kFast}},
      {"bvh_fast", {.kind = StructureKind::kBvh, .quality = BuildQuality::kFast}},
      {"kd_tree", {StructureKind::kKdTree}},
      {"embree", {StructureKind::kEmbree}},
  };
}
// NOLINTNEXTLINE(readability-identifier-naming): the name GoogleTest looks for
inline void PrintTo(const StructureCase& structure, std::ostream* out) {
  *out << structure.name;
}

struct MeshCase {
  std::string name;
  std::shared_ptr<const TriangleMesh> mesh;
};

inline TriangleMesh scaled(TriangleMesh mesh, float factor) {
  for (Vec3f& p : mesh.positions) p *= factor;
  return mesh;
}

/// A sphere among triangles without area: points, needles of zero width, repeated corners.
inline TriangleMesh with_degenerate_triangles() {
  TriangleMesh mesh = test::icosphere(2);
  for (std::uint32_t i = 0; i < 40; ++i) {
    mesh.triangles.push_back({i, i, i});
    mesh.triangles.push_back({i, i + 1, i});
  }
  const auto first = std::uint32_t(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {{-2, 0, 0}, {0, 0, 0}, {2, 0, 0}});
  mesh.triangles.push_back({first, first + 1, first + 2});
  return mesh;
}

inline const std::vector<MeshCase>& mesh_cases() {
  static const std::vector<MeshCase> cases = [] {
    std::vector<MeshCase> all;
    auto add = [&](const std::string& name, TriangleMesh mesh) {
      all.push_back({name, test::share(std::move(mesh))});
    };
    add("one triangle", test::single_triangle());
    add("box", test::box({-1, -1, -1}, {1, 2, 3}));
    add("icosphere", test::icosphere(2));
    add("jittered icosphere", test::jittered_icosphere(3, 5));
    add("torus", test::torus(24, 16));
    add("needle fan", test::needle_fan(600));
    for (const float aspect : {1e2F, 1e4F, 1e6F})
      add("slivers " + std::to_string(int(aspect)), test::slivers(300, 11, aspect));
    add("soup", test::soup(600, 12, 0.2F));
    add("quad grid", test::quad_grid(16));
    add("repeated", test::repeated(test::icosphere(1), 12));
    add("degenerate triangles", with_degenerate_triangles());
    add("translated", test::translated(test::jittered_icosphere(2, 6), Vec3f(1e6F, -1e6F, 1e6F)));
    add("tiny", scaled(test::jittered_icosphere(2, 7), 1e-30F));
    add("huge", scaled(test::jittered_icosphere(2, 8), 1e15F));
    return all;
  }();
  return cases;
}

/// A ray in object space and the triangle it must not hit.
struct RayCase {
  Ray ray;
  std::uint32_t excluded = kInvalidId;
};

/// Rays of one seed around one mesh.
class RayMaker {
 public:
  RayMaker(const TriangleMesh& mesh, std::uint64_t seed)
      : mesh_(mesh), random_(seed), bounds_(to_double(mesh.bounds())), size_(max_abs(bounds_.extent())) {}

  Ray through_space() { return {around(), random_.direction()}; }
  Ray at_edge() {
    const auto corners = corner_points();
    const std::size_t i = random_.below(3);
    const double s = random_.below(2) == 0 ? 0.5 : random_.uniform();
    return toward(corners[i] + s * (corners[(i + 1) % 3] - corners[i]));
  }
  Ray at_vertex() { return toward(corner_points()[random_.below(3)]); }

  /// Along an axis, zeros of either sign, the other coordinates random or exactly those of a vertex.
  Ray along_axis() {
    Ray ray{around(), Vec3d(0.0)};
    const Vec3d vertex = corner_points()[random_.below(3)];
    const auto axis = int(random_.below(3));
    for (int i = 0; i < 3; ++i) {
      ray.direction[i] = random_.below(2) == 0 ? 0.0 : -0.0;
      if (random_.below(3) != 0) ray.origin[i] = vertex[i];
    }
    ray.direction[axis] = random_.below(2) == 0 ? 1.0 : -1.0;
    return ray;
  }

  /// At an angle of 1e-1 to 1e-7 to a triangle, or exactly along its plane.
  Ray grazing() {
    const auto corners = corner_points();
    const Vec3d edge = corners[1] - corners[0];
    const Vec3d other = corners[2] - corners[0];
    const Vec3d along = random_.uniform(-1, 1) * edge + random_.uniform(-1, 1) * other;
    const double length = glm::length(along);
    if (!(length > 0.0)) return through_space();
    const double slope = random_.below(4) == 0 ? 0.0 : std::pow(10.0, random_.uniform(-7.0, -1.0));
    const Vec3d direction = along / length + slope * random_.direction();
    const Vec3d target = corners[0] + random_.uniform(0.0, 0.5) * edge + random_.uniform(0.0, 0.5) * other;
    return {target - random_.uniform(0.0, 2.0) * size_ * direction, direction};
  }

  /// All of the above, with ranges and direction lengths of every kind.
  RayCase any() {
    RayCase made;
    switch (random_.below(5)) {
      case 0:
        made.ray = through_space();
        break;
      case 1:
        made.ray = at_edge();
        break;
      case 2:
        made.ray = at_vertex();
        break;
      case 3:
        made.ray = along_axis();
        break;
      default:
        made.ray = grazing();
        break;
    }
    const double length = max_abs(made.ray.direction);
    switch (random_.below(6)) {
      case 0:
        made.ray.tnear = -4.0 * size_ / length;
        break;
      case 1:
        made.ray.tfar = random_.uniform(0.0, 2.0) * size_ / length;
        break;
      case 2:
        made.ray.direction *= std::pow(2.0, random_.uniform(-30.0, 30.0));
        break;
      case 3:
        made.excluded = random_.below(std::uint32_t(mesh_.triangle_count()));
        break;
      default:
        break;
    }
    return made;
  }

  Random& random() { return random_; }

 private:
  std::array<Vec3d, 3> corner_points() {
    const auto corners = mesh_.corners(random_.below(std::uint32_t(mesh_.triangle_count())));
    return {Vec3d(corners[0]), Vec3d(corners[1]), Vec3d(corners[2])};
  }
  Vec3d around() { return bounds_.center() + size_ * random_.in_box(1.0); }
  Ray toward(const Vec3d& target) {
    const Vec3d origin = around();
    const double stretch = random_.below(2) == 0 ? 1.0 : random_.uniform(0.2, 3.0);
    return target == origin ? through_space() : Ray{origin, stretch * (target - origin)};
  }

  const TriangleMesh& mesh_;
  Random random_;
  Bounds3d bounds_;
  double size_;
};

/// The closest hit of a structure; misses keep the initial hit.
template <Precision kPrecision>
Hit closest(const Blas& blas, const RayCase& ray) {
  Hit best;
  best.t = ray.ray.tfar;
  mesh::ObjectRay prepared;
  if (!prepared.prepare(ray.ray, blas.bounds())) return best;
  prepared.excluded_primitive = ray.excluded;
  blas.intersect<kPrecision>(prepared, best);
  return best;
}

template <Precision kPrecision>
bool any(const Blas& blas, const RayCase& ray) {
  mesh::ObjectRay prepared;
  if (!prepared.prepare(ray.ray, blas.bounds())) return false;
  prepared.excluded_primitive = ray.excluded;
  return blas.occluded<kPrecision>(prepared, ray.ray.tfar);
}

}  // namespace gridcast::blas
