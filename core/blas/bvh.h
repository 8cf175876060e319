#pragma once
// A binary bounding volume hierarchy over the triangles of one mesh.

#include <cstdint>
#include <memory>
#include <stop_token>
#include <vector>

#include "core/blas/blas.h"
#include "core/blas/bvh_node.h"
#include "core/blas/collector.h"
#include "core/blas/point_sink.h"
#include "core/blas/tree_bytes.h"

namespace gridcast::blas {

class Bvh {
 public:
  /// kCancelled on `stop`; kLimitExceeded for more than kMaxBvhPrimitives triangles.
  [[nodiscard]] static Result<std::shared_ptr<const Bvh>> build(const mesh::TriangleMesh& mesh,
                                                                const BuildOptions& options,
                                                                std::stop_token stop);

  /// The same tree with its boxes drawn around the moved triangles, bit for bit the min and max of their
  /// corners. `moved` has the triangles of the mesh this was built from.
  [[nodiscard]] Result<std::shared_ptr<const Bvh>> refit(const mesh::TriangleMesh& moved) const;

  /// The columns of this tree, and the tree again; what read() accepts can be asked, refitted and validated,
  /// whatever the bytes are. kInvalidFile names what is wrong.
  void write(TreeWriter& out) const;
  [[nodiscard]] static Result<std::shared_ptr<const Bvh>> read(const mesh::TriangleMesh& mesh,
                                                               TreeReader& in);

  /// True when an offer narrowed the range or ended the traversal.
  template <Precision kPrecision, Collector C>
  bool intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const;

  /// Offers the triangles around sink.center(); see PointSink.
  void search(const mesh::TriangleMesh& mesh, PointSink& sink) const;

  /// Boxes contain their children and triangles, every triangle is in one leaf, links are in range, depth is
  /// bounded. The error's `where` names the node (`/nodes/17`).
  [[nodiscard]] Status validate(const mesh::TriangleMesh& mesh) const;
  void add_stats(StructureStats& stats) const;

  /// Read access for tests and for drawing.
  [[nodiscard]] const BvhNodes& nodes() const { return nodes_; }
  /// In the order of the leaves; null for a mesh without triangles.
  [[nodiscard]] const std::vector<std::uint32_t>* primitive_ids() const { return primitive_ids_.get(); }

 private:
  BvhNodes nodes_;
  /// Triangle ids in the order of the leaves; shared by every refit of the same build.
  std::shared_ptr<const std::vector<std::uint32_t>> primitive_ids_;
};

}  // namespace gridcast::blas
