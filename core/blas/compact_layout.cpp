#include "core/blas/compact_layout.h"

#include <array>

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/wide_view.h"

namespace gridcast::blas {
namespace {

/// Slots of a wide node in the order of the compact one: inner children, then leaves.
struct SlotOrder {
  std::array<std::uint8_t, 8> slots{};
  std::uint32_t inner = 0;
  std::uint32_t count = 0;

  explicit SlotOrder(const WideNode& node) {
    for (const bool leaf : {false, true}) {
      for (std::uint32_t slot = 0; slot < node.slots; ++slot)
        if (wide_child::is_leaf(node.child[slot]) == leaf) slots[count++] = std::uint8_t(slot);
      if (!leaf) inner = count;
    }
  }
};

/// Copies links, in the order of the compact layout; boxes come later, in parallel.
class Links {
 public:
  explicit Links(const WideBvh& tree) : tree_(tree.nodes()), view_(view_of(tree)) {
    wide_of_.resize(tree_.size());
    layout_.nodes.resize(tree_.size());
    layout_.ids.reserve(count_ids(tree.blocks()));
  }

  /// The layout, and the wide node of each of its nodes.
  std::pair<CompactLayout, std::vector<std::uint32_t>> copy() && {
    std::uint32_t next_node = 1;
    std::vector<std::uint32_t> pending{0};
    while (!pending.empty()) {
      const std::uint32_t index = pending.back();
      pending.pop_back();
      const WideNode& from = tree_[wide_of_[index]];
      const SlotOrder order(from);
      CompactNode& to = layout_.nodes[index];
      to.counts = std::uint8_t(order.inner | (order.count << 4U));
      to.first_child = order.inner != 0 ? next_node : 0;
      for (std::uint32_t i = 0; i < order.inner; ++i) wide_of_[next_node + i] = from.child[order.slots[i]];
      add_leaves(from, order, to);
      next_node += order.inner;
      for (std::uint32_t i = order.inner; i-- > 0;) pending.push_back(to.first_child + i);
    }
    return {std::move(layout_), std::move(wide_of_)};
  }

 private:
  static std::size_t count_ids(const TriangleBlocks& blocks) {
    std::size_t count = 0;
    for (const TriangleBlock& block : blocks) count += triangles_in(block);
    return count;
  }

  void add_leaves(const WideNode& from, const SlotOrder& order, CompactNode& to) {
    std::vector<std::uint32_t>& ids = layout_.ids;
    const std::size_t first = ids.size();
    to.first_id = std::uint32_t(first);
    for (std::uint32_t i = 0; i < 8; ++i) {
      to.ends[i] = 0;
      if (i < order.inner || i >= order.count) continue;
      view_.for_blocks(from.child[order.slots[i]], [&](const TriangleBlock& block) {
        ids.insert(ids.end(), block.ids, block.ids + triangles_in(block));
        return true;
      });
      to.ends[i] = std::uint8_t(ids.size() - first);
    }
  }

  const WideNodes& tree_;
  WideView view_;
  std::vector<std::uint32_t> wide_of_;
  CompactLayout layout_;
};

}  // namespace

Result<CompactLayout> compacted(const WideBvh& tree) {
  if (tree.nodes().empty()) return CompactLayout{};
  auto [layout, wide_of] = Links(tree).copy();
  if (layout.ids.size() > compact_child::kIndexMask) {
    return Error{ErrorCode::kLimitExceeded, "more than 2^28 triangles in the leaves of a compact BVH",
                 "/triangles"};
  }
  oneapi::tbb::parallel_for(std::size_t(0), layout.nodes.size(),
                            [&, &layout = layout, &wide_of = wide_of](std::size_t i) {
                              const WideNode& from = tree.nodes()[wide_of[i]];
                              const SlotOrder order(from);
                              std::array<Bounds3f, 8> boxes;
                              for (std::uint32_t slot = 0; slot < order.count; ++slot)
                                boxes[slot] = from.box(order.slots[slot]);
                              layout.nodes[i].set_boxes(std::span(boxes).first(order.count));
                            });
  return std::move(layout);
}

}  // namespace gridcast::blas
