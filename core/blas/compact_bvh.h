#pragma once
// The wide tree in an eighth of its memory: nodes of 80 bytes, and leaves that name triangles and hold no
// corners.

#include <memory>
#include <stop_token>
#include <vector>

#include "core/blas/blas.h"
#include "core/blas/collector.h"
#include "core/blas/compact_node.h"
#include "core/blas/compact_view.h"
#include "core/blas/exact_packet.h"
#include "core/blas/point_sink.h"
#include "core/blas/tree_bytes.h"

namespace gridcast::blas {

class WideBvh;

class CompactBvh {
 public:
  /// The tree that WideBvh::build makes of the same options, written smaller. Its errors; kLimitExceeded
  /// when leaves name more than 2^28 - 1 triangles, shared ones counted once a leaf.
  [[nodiscard]] static Result<std::shared_ptr<const CompactBvh>> build(const mesh::TriangleMesh& mesh,
                                                                       const BuildOptions& options,
                                                                       std::stop_token stop);

  /// The same tree over moved vertices; bit for bit that of a build with this shape. A leaf that had a part
  /// of a triangle gets the box of the whole: right, but worse.
  [[nodiscard]] Result<std::shared_ptr<const CompactBvh>> refit(const mesh::TriangleMesh& moved) const;

  /// As Bvh::write and Bvh::read.
  void write(TreeWriter& out) const;
  [[nodiscard]] static Result<std::shared_ptr<const CompactBvh>> read(const mesh::TriangleMesh& mesh,
                                                                      TreeReader& in);

  /// True when an offer narrowed the range or ended the traversal.
  template <Precision kPrecision, Collector C>
  bool intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const;

  /// Offers the triangles around sink.center(); see PointSink.
  void search(const mesh::TriangleMesh& mesh, PointSink& sink) const;

  /// As WideBvh::intersect_packet.
  template <Precision kPrecision, bool kAnyHit>
  PacketResult intersect_packet(const mesh::TriangleMesh& mesh, const Bounds3f& bounds,
                                const PacketOf<kPrecision>& packet, BestOf<kPrecision>* best) const;

  /// Links are in order, every triangle is in a leaf, and what a path of boxes leaves of space contains the
  /// triangles at its end. Boxes need not contain those of their children, which are rounded on finer grids.
  /// The error's `where` names the node (`/nodes/17`) or the triangle (`/triangles/3`).
  [[nodiscard]] Status validate(const mesh::TriangleMesh& mesh) const;
  void add_stats(StructureStats& stats) const;

  [[nodiscard]] const CompactNodes& nodes() const { return nodes_; }
  /// In the order of the leaves.
  [[nodiscard]] const std::vector<std::uint32_t>& ids() const { return *ids_; }
  [[nodiscard]] CompactView view(const mesh::TriangleMesh& mesh) const {
    return {nodes_.data(), ids_->data(), mesh.triangles.data(), mesh.positions.data()};
  }

 private:
  CompactNodes nodes_;
  std::shared_ptr<const std::vector<std::uint32_t>> ids_;  ///< shared by every refit of the same build
  SpatialSplits spatial_ = SpatialSplits::kNever;          ///< whether several leaves may hold a triangle
};

}  // namespace gridcast::blas
