#include "core/blas/kd_tree.h"

namespace gridcast::blas {
namespace {

struct Entry {
  double distance;
  Bounds3f cell;
  std::uint32_t link;
  std::uint32_t blocks;  ///< 0: a treelet
};

void offer_blocks(const KdLayout& tree, const Entry& leaf, PointSink& sink) {
  for (std::uint32_t b = leaf.link; b < leaf.link + leaf.blocks; ++b) {
    const KdBlock& block = tree.blocks[b];
    for (std::uint32_t i = 0; i < block.size(); ++i) sink.offer(tree.triangles[block.triangles[i]].id);
  }
}

}  // namespace

// Depth first, nearer cells first. The point of a triangle that is nearest lies in a leaf that lists it, so
// the distance of the cell bounds that of what matters there.
void KdTree::search(const mesh::TriangleMesh& /*mesh*/, PointSink& sink) const {
  if (layout_.treelets.empty()) return;
  Entry stack[kKdStackSize];
  std::size_t size = 0;
  stack[size++] = {squared_distance(sink.center(), layout_.bounds), layout_.bounds, 0, 0};
  while (size != 0) {
    const Entry next = stack[--size];
    if (next.distance > sink.limit()) continue;
    if (next.blocks != 0) {
      offer_blocks(layout_, next, sink);
      continue;
    }
    const KdTreelet& treelet = layout_.treelets[next.link];
    const std::size_t bottom = size;
    for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
      if (!treelet.is_used(slot)) continue;
      const Bounds3f cell = treelet.child_cell(slot, next.cell);
      const double distance = squared_distance(sink.center(), cell);
      if (distance > sink.limit()) continue;
      std::size_t place = size++;
      for (; place > bottom && stack[place - 1].distance < distance; --place) stack[place] = stack[place - 1];
      const bool inner = treelet.is_inner(slot);
      stack[place] = {distance, cell, inner ? treelet.child(slot) : treelet.block(slot),
                      inner ? 0U : treelet.block_count(slot)};
    }
  }
}

}  // namespace gridcast::blas
