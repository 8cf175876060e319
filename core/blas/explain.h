#pragma once
// Walks that tell what the traversal kernels do, step by step, a part of Blas::explain.
//
// The same as in the kernel of each structure: the nodes, leaves and triangles looked at, in order; what is
// skipped because it begins behind the best hit; which triangles the filter keeps from the test (block
// by block of four, with the best hit as it was before the leaf); every hit that is offered. The slab tests
// and the filter are the kernel's own, with the instructions in use (kernel_steps.h), so another instruction
// set may show another way where its rounding differs. Not the same: a triangle that fills up a block once
// more is told once, where the kernel tests it again without effect. Told for a single ray's closest hit: any
// hit and packets order their visits otherwise. Embree's tree is one step.

#include <algorithm>
#include <concepts>
#include <optional>

#include "core/blas/brute_force.h"
#include "core/blas/bvh.h"
#include "core/blas/compact_bvh.h"
#include "core/blas/embree_tree.h"
#include "core/blas/kd_tree.h"
#include "core/blas/wide_bvh.h"
#include "core/math/ray_way.h"

namespace gridcast::blas {

template <Precision kPrecision, Collector C>
void explain(const BruteForce& all, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
             RayWay& way);
template <Precision kPrecision, Collector C>
void explain(const Bvh& tree, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
             RayWay& way);
template <Precision kPrecision, Collector C>
void explain(const WideBvh& tree, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
             RayWay& way);
template <Precision kPrecision, Collector C>
void explain(const CompactBvh& tree, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
             RayWay& way);
template <Precision kPrecision, Collector C>
void explain(const KdTree& tree, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
             RayWay& way);
template <Precision kPrecision, Collector C>
void explain(const EmbreeTree& tree, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
             RayWay& way);

/// Where the walks of a file are compiled: for each precision with what keeps its closest hit.
#define GRIDCAST_INSTANTIATE_EXPLAIN(Structure)                                            \
  template void explain<Precision::kFast>(const Structure&, const mesh::TriangleMesh&,     \
                                          const mesh::ObjectRay&, ClosestHit&, RayWay&);   \
  template void explain<Precision::kRobust>(const Structure&, const mesh::TriangleMesh&,   \
                                            const mesh::ObjectRay&, ClosestHit&, RayWay&); \
  template void explain<Precision::kExact>(const Structure&, const mesh::TriangleMesh&,    \
                                           const mesh::ObjectRay&, ExactClosest&, RayWay&)

/// The ray's t at a distance of its culling half, not before tnear.
[[nodiscard]] inline double t_at(const mesh::ObjectRay& ray, float s) {
  return std::max(ray.tnear, (double(s) + ray.cull_shift) / ray.cull_scale);
}

/// Passes offers on and remembers the last.
template <Collector C>
struct Watched {
  using Candidate = typename C::Candidate;
  static constexpr bool kStopsAtFirst = C::kStopsAtFirst;
  C& inner;
  std::optional<double> t = std::nullopt;
  bool is_best = false;

  [[nodiscard]] double tfar() const { return inner.tfar(); }
  Offer offer(const mesh::ObjectRay& ray, const Candidate& hit, std::uint32_t primitive_id) {
    const Offer said = inner.offer(ray, hit, primitive_id);
    t = hit.t;
    is_best = said == Offer::kNarrowed;
    return said;
  }
};

/// Tests a triangle as the kernels do and tells the verdict. False when the way ends.
template <Precision kPrecision, Collector C>
bool explain_triangle(const mesh::ObjectRay& ray, const Vec3f& p0, const Vec3f& p1, const Vec3f& p2,
                      std::uint32_t primitive_id, C& collector, RayWay& way) {
  Watched<C> watched{collector};
  test_triangle<kPrecision>(ray, p0, p1, p2, primitive_id, watched);
  TriangleStep step{primitive_id, TriangleVerdict::kMissed, watched.is_best, watched.t};
  if (watched.t) {
    const bool in_range = watched.is_best || (*watched.t >= ray.tnear && *watched.t <= way.tfar());
    step.verdict = primitive_id == ray.excluded_primitive ? TriangleVerdict::kExcluded
                   : in_range                             ? TriangleVerdict::kHit
                                                          : TriangleVerdict::kOutOfRange;
  }
  return way.add(step);
}

}  // namespace gridcast::blas
