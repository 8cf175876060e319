#include <utility>

#include "core/blas/bvh.h"
#include "core/blas/tree_check.h"

namespace gridcast::blas {
namespace {

/// Nodes in the order that a refit relies on, leaves that share out the triangles, no path longer than a
/// traversal's stack.
class Check {
 public:
  Check(const BvhNodes& nodes, const std::vector<std::uint32_t>& ids, const mesh::TriangleMesh& mesh)
      : nodes_(nodes), ids_(ids), mesh_(mesh), listed_(ids.size()) {}

  Status run() {
    if (ids_.size() != mesh_.triangle_count()) return wrong_tree("is of another mesh", 0);
    if (nodes_.empty()) return ids_.empty() ? ok_status() : wrong_tree("has no root", 0);
    if (nodes_.size() < 2) return wrong_tree("ends in its root", 0);
    if (Status status = check_ids(); !status) return status;
    std::size_t next_pair = 2;
    std::vector<Visit> pending{{0, 0}};
    while (!pending.empty()) {
      const Visit visit = pending.back();
      pending.pop_back();
      const BvhNode& node = nodes_[visit.node];
      if (!is_proper_box(node.bounds())) return wrong_tree("has a node without a box", visit.node);
      if (node.leaf()) {
        if (Status status = check_leaf(visit.node); !status) return status;
        continue;
      }
      if (visit.depth >= kMaxBvhDepth) return wrong_tree("is too deep", visit.node);
      if (node.first != next_pair || next_pair + 2 > nodes_.size())
        return wrong_tree("has a node out of order", visit.node);
      next_pair += 2;
      pending.push_back({node.first + std::size_t(1), visit.depth + 1});
      pending.push_back({node.first, visit.depth + 1});
    }
    if (next_pair != nodes_.size()) return wrong_tree("has nodes that nothing links to", next_pair);
    return listed_.all() ? ok_status() : wrong_tree("leaves out triangles", 0);
  }

 private:
  struct Visit {
    std::size_t node, depth;
  };

  Status check_ids() {
    Once named(ids_.size());
    for (const std::uint32_t id : ids_)
      if (id >= ids_.size() || !named.name(id)) return wrong_tree("does not list every triangle once", 0);
    return ok_status();
  }

  Status check_leaf(std::size_t index) {
    const BvhNode& leaf = nodes_[index];
    const std::size_t end = std::size_t(leaf.first) + leaf.count;
    if (end > ids_.size()) return wrong_tree("has a leaf beyond the triangles", index);
    for (std::size_t i = leaf.first; i < end; ++i)
      if (!listed_.name(i)) return wrong_tree("has leaves that overlap", index);
    return ok_status();
  }

  const BvhNodes& nodes_;
  const std::vector<std::uint32_t>& ids_;
  const mesh::TriangleMesh& mesh_;
  Once listed_;  ///< places of ids_
};

}  // namespace

void Bvh::write(TreeWriter& out) const {
  out.reserve(nodes_.size() * sizeof(BvhNode) + primitive_ids_->size() * sizeof(std::uint32_t) + 64);
  out.column(nodes_);
  out.column(*primitive_ids_);
}

Result<std::shared_ptr<const Bvh>> Bvh::read(const mesh::TriangleMesh& mesh, TreeReader& in) {
  auto bvh = std::make_shared<Bvh>();
  std::vector<std::uint32_t> ids;
  in.column(bvh->nodes_);
  in.column(ids);
  if (Status status = Check(bvh->nodes_, ids, mesh).run(); !status) return status.error();
  bvh->primitive_ids_ = std::make_shared<const std::vector<std::uint32_t>>(std::move(ids));
  return std::shared_ptr<const Bvh>(std::move(bvh));
}

}  // namespace gridcast::blas
