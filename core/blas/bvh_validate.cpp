#include <string>

#include "core/blas/bvh.h"

namespace gridcast::blas {
namespace {

class Validator {
 public:
  Validator(const BvhNodes& nodes, const std::vector<std::uint32_t>& ids, const mesh::TriangleMesh& mesh)
      : nodes_(nodes), ids_(ids), mesh_(mesh), node_seen_(nodes.size()), triangle_seen_(ids.size()) {}

  Status run() {
    if (ids_.size() != mesh_.triangle_count()) {
      return Error{ErrorCode::kInternal,
                   "the tree lists " + std::to_string(ids_.size()) + " triangles, the mesh has " +
                       std::to_string(mesh_.triangle_count()),
                   "/primitive_ids"};
    }
    if (nodes_.empty()) return ids_.empty() ? ok_status() : wrong(0, "is missing");
    pending_.push_back({0, 0});
    while (!pending_.empty()) {
      const Visit visit = pending_.back();
      pending_.pop_back();
      Status status = nodes_[visit.node].leaf() ? leaf(visit.node) : inner(visit);
      if (!status) return status;
    }
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (i > 1 && !node_seen_[i]) return wrong(i, "is not reachable from the root");
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      if (triangle_seen_[i]) continue;
      return Error{ErrorCode::kInternal, "the triangle is in no leaf", "/triangles/" + std::to_string(i)};
    }
    return ok_status();
  }

 private:
  struct Visit {
    std::size_t node, depth;
  };

  static Error wrong(std::size_t node, const std::string& what) {
    return {ErrorCode::kInternal, "the node " + what, "/nodes/" + std::to_string(node)};
  }

  Status inner(const Visit& visit) {
    const BvhNode& node = nodes_[visit.node];
    if (visit.depth >= kMaxBvhDepth) return wrong(visit.node, "is deeper than the traversal's stack");
    if (node.first % 2 != 0 || node.first <= visit.node || node.first + std::size_t(1) >= nodes_.size())
      return wrong(visit.node, "links to " + std::to_string(node.first) + ", out of range or order");
    for (std::size_t child = node.first; child < node.first + std::size_t(2); ++child) {
      if (node_seen_[child]) return wrong(child, "has two parents");
      node_seen_[child] = true;
      if (!node.bounds().contains(nodes_[child].bounds()))
        return wrong(visit.node, "does not contain its child " + std::to_string(child));
      pending_.push_back({child, visit.depth + 1});
    }
    return ok_status();
  }

  Status leaf(std::size_t index) {
    const BvhNode& node = nodes_[index];
    const std::size_t end = std::size_t(node.first) + node.count;
    if (end > ids_.size()) return wrong(index, "lists triangles beyond the end of the order");
    for (std::size_t i = node.first; i < end; ++i) {
      const std::uint32_t id = ids_[i];
      if (id >= mesh_.triangle_count()) return wrong(index, "names triangle " + std::to_string(id));
      if (triangle_seen_[id]) return wrong(index, "lists a second time triangle " + std::to_string(id));
      triangle_seen_[id] = true;
      if (!node.bounds().contains(mesh_.triangle_bounds(id)))
        return wrong(index, "does not contain triangle " + std::to_string(id));
    }
    return ok_status();
  }

  const BvhNodes& nodes_;
  const std::vector<std::uint32_t>& ids_;
  const mesh::TriangleMesh& mesh_;
  std::vector<bool> node_seen_;
  std::vector<bool> triangle_seen_;
  std::vector<Visit> pending_;
};

}  // namespace

Status Bvh::validate(const mesh::TriangleMesh& mesh) const {
  return Validator(nodes_, *primitive_ids_, mesh).run();
}

}  // namespace gridcast::blas
