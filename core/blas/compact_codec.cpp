#include <cmath>
#include <utility>

#include "core/blas/bvh_node.h"
#include "core/blas/compact_bvh.h"
#include "core/blas/tree_check.h"

namespace gridcast::blas {
namespace {

/// Nodes and ids in the one order that a layout has, no path longer than a traversal's stack.
class Check {
 public:
  Check(const CompactNodes& nodes, const std::vector<std::uint32_t>& ids) : nodes_(nodes), ids_(ids) {}

  Status run() {
    if (nodes_.empty()) return ids_.empty() ? ok_status() : wrong_tree("has no root", 0);
    std::vector<Visit> pending{{0, 0}};
    while (!pending.empty()) {
      const Visit visit = pending.back();
      pending.pop_back();
      if (visit.depth > kMaxBvhDepth) return wrong_tree("is too deep", visit.node);
      if (Status status = check_node(visit.node); !status) return status;
      const CompactNode& node = nodes_[visit.node];
      for (std::uint32_t slot = node.inner_count(); slot-- > 0;)
        pending.push_back({node.first_child + slot, visit.depth + 1});
    }
    return next_node_ == nodes_.size() && next_id_ == ids_.size()
               ? ok_status()
               : wrong_tree("has parts that nothing links to", 0);
  }

 private:
  struct Visit {
    std::uint32_t node;
    std::size_t depth;
  };

  Status check_node(std::uint32_t index) {
    const CompactNode& node = nodes_[index];
    const std::uint32_t inner = node.inner_count(), slots = node.slot_count();
    if (slots == 0 || slots > 8 || inner > slots) return wrong_tree("uses no slot or more than eight", index);
    if (!has_boxes(node)) return wrong_tree("has a slot with a wrong box", index);
    if (node.first_child != (inner != 0 ? next_node_ : 0) || node.first_id != next_id_)
      return wrong_tree("has a link out of order", index);
    std::uint32_t end = 0;
    for (std::uint32_t slot = 0; slot < 8; ++slot) {
      const bool leaf = slot >= inner && slot < slots;
      if (!leaf && node.ends[slot] != 0) return wrong_tree("has triangles outside of leaves", index);
      if (!leaf) continue;
      if (node.ends[slot] <= end || node.ends[slot] > end + 8)
        return wrong_tree("has a leaf of no triangle or more than eight", index);
      end = node.ends[slot];
    }
    next_node_ += inner;
    next_id_ += end;
    return next_node_ <= nodes_.size() && next_id_ <= ids_.size() ? ok_status()
                                                                  : wrong_tree("links out of range", index);
  }

  static bool has_boxes(const CompactNode& node) {
    for (int axis = 0; axis < 3; ++axis)
      if (node.exponents[axis] == 0 || node.exponents[axis] == 255) return false;
    for (std::uint32_t slot = 0; slot < node.slot_count(); ++slot)
      if (!is_proper_box(node.box(slot))) return false;
    return true;
  }

  const CompactNodes& nodes_;
  const std::vector<std::uint32_t>& ids_;
  std::uint32_t next_node_ = 1;
  std::uint32_t next_id_ = 0;
};

/// Whether leaves name every triangle, those that share none once.
Status check_ids(const std::vector<std::uint32_t>& ids, std::size_t triangle_count, SpatialSplits spatial) {
  Once named(triangle_count);
  for (const std::uint32_t id : ids) {
    if (id >= triangle_count) return wrong_tree("names a triangle that the mesh has not", 0);
    if (!named.name(id) && spatial == SpatialSplits::kNever) return wrong_tree("lists a triangle twice", 0);
  }
  return named.all() ? ok_status() : wrong_tree("does not list every triangle", 0);
}

}  // namespace

void CompactBvh::write(TreeWriter& out) const {
  out.reserve(nodes_.size() * sizeof(CompactNode) + ids_->size() * sizeof(std::uint32_t) + 64);
  out.value(spatial_);
  out.column(nodes_);
  out.column(*ids_);
}

Result<std::shared_ptr<const CompactBvh>> CompactBvh::read(const mesh::TriangleMesh& mesh, TreeReader& in) {
  auto made = std::make_shared<CompactBvh>();
  const auto spatial = in.value<std::uint8_t>();
  std::vector<std::uint32_t> ids;
  in.column(made->nodes_);
  in.column(ids);
  if (in.failed() || spatial > std::uint8_t(SpatialSplits::kNever) || ids.size() > compact_child::kIndexMask)
    return wrong_tree("breaks its format", 0);
  made->spatial_ = SpatialSplits(spatial);
  if (Status status = Check(made->nodes_, ids).run(); !status) return status.error();
  if (Status status = check_ids(ids, mesh.triangle_count(), made->spatial_); !status) return status.error();
  made->ids_ = std::make_shared<const std::vector<std::uint32_t>>(std::move(ids));
  return std::shared_ptr<const CompactBvh>(std::move(made));
}

}  // namespace gridcast::blas
