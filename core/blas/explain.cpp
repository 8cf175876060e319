#include "core/blas/explain.h"

#include <type_traits>

namespace gridcast::blas {

template <Precision kPrecision, Collector C>
void explain(const BruteForce& /*all*/, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray,
             C& collector, RayWay& way) {
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    const auto [p0, p1, p2] = mesh.corners(id);
    if (!explain_triangle<kPrecision>(ray, p0, p1, p2, id, collector, way)) return;
  }
}

template <Precision kPrecision, Collector C>
void explain(const EmbreeTree& tree, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
             RayWay& way) {
  if (!way.goes_on()) return;
  const bool narrowed = tree.intersect<kPrecision>(mesh, ray, collector);
  way.add(OpaqueStep{to_string(StructureKind::kEmbree), narrowed});
}

GRIDCAST_INSTANTIATE_EXPLAIN(BruteForce);
GRIDCAST_INSTANTIATE_EXPLAIN(EmbreeTree);

template <Precision kPrecision, class Best>
void Blas::explain(const mesh::ObjectRay& ray, Best& best, RayWay& way) const {
  std::conditional_t<kPrecision == Precision::kExact, ExactClosest, ClosestHit> collector{best};
  if constexpr (kPrecision == Precision::kExact)
    if (!ray.exact->is_close) return blas::explain<kPrecision>(BruteForce(), *mesh_, ray, collector, way);
  std::visit(
      [&](const auto& structure) { blas::explain<kPrecision>(*structure, *mesh_, ray, collector, way); },
      structure_);
}

template void Blas::explain<Precision::kFast>(const mesh::ObjectRay&, Hit&, RayWay&) const;
template void Blas::explain<Precision::kRobust>(const mesh::ObjectRay&, Hit&, RayWay&) const;
template void Blas::explain<Precision::kExact>(const mesh::ObjectRay&, mesh::ExactBest&, RayWay&) const;

}  // namespace gridcast::blas
