#include <algorithm>

#include "core/blas/compact_bvh.h"
#include "core/blas/wide_view.h"

namespace gridcast::blas {
namespace {

using Planes = float[2][3][8];  ///< [lower, upper][axis][slot]

/// The planes of a node; `decoded` is room for those that are not there as floats.
const Planes& planes_of(const WideNode& node, Planes& /*decoded*/) {
  return node.planes;
}
const Planes& planes_of(const CompactNode& node, Planes& decoded) {
  for (int side = 0; side < 2; ++side)
    for (int axis = 0; axis < 3; ++axis)
      for (std::uint32_t slot = 0; slot < 8; ++slot) decoded[side][axis][slot] = node.plane(side, axis, slot);
  return decoded;
}

/// Squared distances of all eight boxes; plain loops over slots, which compilers turn into vectors.
void distances_to(const Planes& planes, const Vec3d& point, double (&squared)[8]) {
  std::fill(std::begin(squared), std::end(squared), 0.0);
  for (int axis = 0; axis < 3; ++axis) {
    const double p = point[axis];
    const float* lower = planes[0][axis];
    const float* upper = planes[1][axis];
    for (std::size_t slot = 0; slot < 8; ++slot) {
      const double outside = std::max(std::max(double(lower[slot]) - p, p - double(upper[slot])), 0.0);
      squared[slot] += outside * outside;
    }
  }
}

void offer_block(const std::uint32_t* ids, std::uint32_t count, PointSink& sink) {
  for (std::uint32_t i = 0; i < count; ++i) sink.offer(ids[i]);
}
void offer_leaf(const WideView& tree, std::uint32_t link, PointSink& sink) {
  tree.for_blocks(link, [&](const TriangleBlock& block) {
    offer_block(block.ids, triangles_in(block), sink);
    return true;
  });
}
void offer_leaf(const CompactView& tree, std::uint32_t link, PointSink& sink) {
  offer_block(tree.ids + compact_child::first_id(link), compact_child::count(link), sink);
}

// Depth first, nearer children first.
template <class View>
void search_tree(const View& tree, PointSink& sink) {
  struct Entry {
    double distance;
    std::uint32_t link;
  };
  Entry stack[kWideStackSize];
  std::size_t size = 0;
  double squared[8];
  Planes decoded;
  std::uint32_t link = 0;
  for (;;) {
    if (wide_child::is_leaf(link)) {
      offer_leaf(tree, link, sink);
    } else {
      const auto& node = tree.nodes[link];
      distances_to(planes_of(node, decoded), sink.center(), squared);
      const std::size_t bottom = size;
      for (std::uint32_t slot = 0; slot < tree.slot_count(node); ++slot) {
        if (squared[slot] > sink.limit()) continue;
        std::size_t place = size++;
        for (; place > bottom && stack[place - 1].distance < squared[slot]; --place)
          stack[place] = stack[place - 1];
        stack[place] = {squared[slot], tree.child(node, slot)};
      }
    }
    do {
      if (size == 0) return;
      --size;
    } while (stack[size].distance > sink.limit());
    link = stack[size].link;
  }
}

}  // namespace

void WideBvh::search(const mesh::TriangleMesh& /*mesh*/, PointSink& sink) const {
  if (!nodes().empty()) search_tree(view_of(*this), sink);
}

void CompactBvh::search(const mesh::TriangleMesh& mesh, PointSink& sink) const {
  if (!nodes_.empty()) search_tree(view(mesh), sink);
}

}  // namespace gridcast::blas
