#include <array>

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/block_bounds.h"
#include "core/blas/wide_bvh.h"

namespace gridcast::blas {
namespace {

/// Subtrees of fewer nodes are refitted by one thread: some tens of microseconds.
constexpr std::size_t kTaskNodes = 128;

/// Copies a tree with new corners and boxes, everything written once.
class Refit {
 public:
  Refit(const WideNodes& old_nodes, const TriangleBlocks& old_blocks, const mesh::TriangleMesh& mesh,
        WideNodes& nodes, TriangleBlocks& blocks)
      : old_nodes_(old_nodes), old_blocks_(old_blocks), mesh_(mesh), nodes_(nodes), blocks_(blocks) {}

  /// The node `self` and those below it, which fill [self, end): depth first, so each inner child's share
  /// starts where the one's before it ends.
  void subtree(std::size_t self, std::size_t end) {
    if (end - self <= kTaskNodes) {
      // Children come after their parents: backwards is bottom up.
      for (std::size_t i = end; i > self; --i) node(i - 1);
      return;
    }
    std::array<std::size_t, 9> begins{};
    std::size_t count = 0;
    for (std::uint32_t slot = 0; slot < old_nodes_[self].slots; ++slot) {
      const std::uint32_t link = old_nodes_[self].child[slot];
      if (!wide_child::is_leaf(link)) begins[count++] = link;
    }
    begins[count] = end;
    oneapi::tbb::parallel_for(std::size_t(0), count,
                              [&](std::size_t i) { subtree(begins[i], begins[i + 1]); });
    node(self);
  }

 private:
  void node(std::size_t index) {
    WideNode& node = nodes_[index];
    node = old_nodes_[index];
    for (std::uint32_t slot = 0; slot < node.slots; ++slot) {
      const std::uint32_t link = node.child[slot];
      node.set_box(slot, wide_child::is_leaf(link) ? leaf(link) : around(nodes_[link]));
    }
  }

  Bounds3f leaf(std::uint32_t link) {
    LaneBounds bounds;
    const std::size_t first = wide_child::index(link);
    for (std::size_t i = first; i < first + wide_child::block_count(link); ++i) {
      TriangleBlock& block = blocks_[i];
      for (std::size_t lane = 0; lane < 4; ++lane) block.ids[lane] = old_blocks_[i].ids[lane];
      load_corners(mesh_, block);
      bounds.extend(block);
    }
    return bounds.bounds();
  }

  /// Unused slots hold inverted boxes, which change nothing.
  static Bounds3f around(const WideNode& node) {
    Bounds3f box;
    for (int axis = 0; axis < 3; ++axis) {
      float lower = node.planes[0][axis][0], upper = node.planes[1][axis][0];
      for (int slot = 1; slot < 8; ++slot) {
        lower = std::min(lower, node.planes[0][axis][slot]);
        upper = std::max(upper, node.planes[1][axis][slot]);
      }
      box.lower[axis] = lower;
      box.upper[axis] = upper;
    }
    return box;
  }

  const WideNodes& old_nodes_;
  const TriangleBlocks& old_blocks_;
  const mesh::TriangleMesh& mesh_;
  WideNodes& nodes_;
  TriangleBlocks& blocks_;
};

}  // namespace

Result<std::shared_ptr<const WideBvh>> WideBvh::refit(const mesh::TriangleMesh& moved) const {
  auto wide = std::make_shared<WideBvh>();
  wide->reference_count_ = reference_count_;
  wide->spatial_ = spatial_;
  wide->nodes_.resize(nodes_.size());
  wide->blocks_.resize(blocks_.size());
  if (!nodes_.empty()) Refit(nodes_, blocks_, moved, wide->nodes_, wide->blocks_).subtree(0, nodes_.size());
  return std::shared_ptr<const WideBvh>(wide);
}

}  // namespace gridcast::blas
