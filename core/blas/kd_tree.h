#pragma once
// A kd-tree over the triangles of one mesh: space is divided, so a triangle may be in several leaves.

#include <memory>
#include <stop_token>

#include "core/blas/blas.h"
#include "core/blas/collector.h"
#include "core/blas/kd_treelet.h"
#include "core/blas/point_sink.h"
#include "core/blas/tree_bytes.h"

namespace gridcast::blas {

class KdTree {
 public:
  /// Surface-area splits at the sides of triangles clipped to the cell: "On building fast kd-trees for ray
  /// tracing, and on doing that in O(N log N)", I. Wald, 2006. Unlike the paper nothing is sorted: cells
  /// above kExactSplits triangles try equally spaced planes, smaller ones count for every side with SIMD,
  /// which is O(N log N) as well because a cell's square is bounded. kCancelled on `stop`; kLimitExceeded
  /// above kMaxKdTriangles.
  [[nodiscard]] static Result<std::shared_ptr<const KdTree>> build(const mesh::TriangleMesh& mesh,
                                                                   std::stop_token stop);

  /// As Bvh::write and Bvh::read. Corners are not written: they are the mesh's.
  void write(TreeWriter& out) const;
  [[nodiscard]] static Result<std::shared_ptr<const KdTree>> read(const mesh::TriangleMesh& mesh,
                                                                  TreeReader& in);

  /// True when an offer narrowed the range or ended the traversal.
  template <Precision kPrecision, Collector C>
  bool intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const;

  /// Offers the triangles around sink.center(); see PointSink.
  void search(const mesh::TriangleMesh& mesh, PointSink& sink) const;

  [[nodiscard]] Status validate(const mesh::TriangleMesh& mesh) const;
  void add_stats(StructureStats& stats) const;

  /// Read access for tests and for drawing.
  [[nodiscard]] const KdLayout& layout() const { return layout_; }

 private:
  KdLayout layout_;
};

/// Planes strictly inside their cells, links and ranges in order, depth within the stack, every triangle
/// listed by each leaf whose cell it enters beyond rounding, and at its corners, edge midpoints and middle by
/// at least one (in a plane either side may). The error's `where` names the node (`/nodes/17`) or the
/// triangle (`/triangles/3`).
[[nodiscard]] Status validate_kd_tree(const KdLayout& layout, const mesh::TriangleMesh& mesh);

}  // namespace gridcast::blas
