// Walks through the trees of eight children a node.

#include "core/blas/compact_bvh.h"
#include "core/blas/wide_walk.h"

namespace gridcast::blas {

template <Precision kPrecision, Collector C>
void explain(const WideBvh& tree, const mesh::TriangleMesh& /*mesh*/, const mesh::ObjectRay& ray,
             C& collector, RayWay& way) {
  if (tree.nodes().empty()) return;
  WideWalk<kPrecision, WideView, C>(view_of(tree), ray, collector, way).run();
}

template <Precision kPrecision, Collector C>
void explain(const CompactBvh& tree, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
             RayWay& way) {
  if (tree.nodes().empty()) return;
  WideWalk<kPrecision, CompactView, C>(tree.view(mesh), ray, collector, way).run();
}

GRIDCAST_INSTANTIATE_EXPLAIN(WideBvh);
GRIDCAST_INSTANTIATE_EXPLAIN(CompactBvh);

}  // namespace gridcast::blas
