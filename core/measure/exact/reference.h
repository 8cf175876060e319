#pragma once
// The exact reference: what the true answers are, however long they take. It shares no code with the engine,
// so that an error of one is not an error of the other.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "core/error.h"
#include "core/math/affine.h"
#include "core/math/ray.h"
#include "core/measure/exact/box_tree.h"
#include "core/measure/exact/triangle.h"

namespace gridcast::measure::exact {

/// Object-space vertices and three vertex numbers a triangle.
struct Mesh {
  std::span<const Vec3f> positions;
  std::span<const std::array<std::uint32_t, 3>> triangles;
};

/// A mesh placed in the world by exactly these doubles.
struct Instance {
  std::uint32_t instance_id = 0;
  std::uint32_t mesh = 0;
  Affine world_from_object;
};

struct Hit {
  PrimitiveRef primitive;
  TriangleHit at;
};

/// Answers the problem that the stored numbers pose, in real arithmetic: world vertices A p + T, the ray's
/// doubles, [tnear, tfar] closed at both ends, ties to the smaller (instance_id, primitive_id), no hit of a
/// triangle without area or in whose plane the ray runs (triangle.h). Rays with components that are not
/// finite hit nothing; tnear and tfar may be infinite.
///
/// A search through boxes and a filter in extended precision (filter.h), both with proven bounds, leave a few
/// triangles a ray; those are decided in integers. Queries may run on any number of threads, and set the
/// floating-point environment to the default meanwhile: denormals are numbers, rounding is to nearest.
class Reference {
 public:
  /// Keeps the spans. kInvalidArgument for vertices or transforms that are not finite and for indices out of
  /// range, kCancelled.
  [[nodiscard]] static Result<Reference> build(std::vector<Mesh> meshes, std::vector<Instance> instances,
                                               const std::stop_token& stop = {});

  /// `excluded` is not hit.
  [[nodiscard]] std::optional<Hit> closest(const Ray& ray, PrimitiveRef excluded = {}) const;
  [[nodiscard]] bool any(const Ray& ray, PrimitiveRef excluded = {}) const;
  /// Every hit, by (t, instance_id, primitive_id).
  [[nodiscard]] std::vector<Hit> all(const Ray& ray, PrimitiveRef excluded = {}) const;
  /// The hit of this one triangle, whatever is before it. Nothing when there is no such triangle.
  [[nodiscard]] std::optional<Hit> of_primitive(const Ray& ray, PrimitiveRef primitive) const;

 private:
  struct Blas {
    Mesh mesh;
    BoxTree tree;
    Box box;
    double extent = 0.0;  ///< largest absolute coordinate
  };
  struct Candidate;
  class Search;

  Reference() = default;
  [[nodiscard]] std::array<Vec3f, 3> corners(const Instance& instance, std::uint32_t primitive_id) const;
  [[nodiscard]] std::optional<Hit> decide(const Ray& ray, const Candidate& candidate) const;

  std::vector<Blas> blas_;
  std::vector<Instance> instances_;  ///< by instance_id
  BoxTree tree_;
};

}  // namespace gridcast::measure::exact
