#include <algorithm>

#include "core/blas/wide_bvh.h"

namespace gridcast::blas {
namespace {

/// Squared distances of all eight boxes; plain loops over slots, which compilers turn into vectors.
void distances_to(const WideNode& node, const Vec3d& point, double (&squared)[8]) {
  std::fill(std::begin(squared), std::end(squared), 0.0);
  for (int axis = 0; axis < 3; ++axis) {
    const double p = point[axis];
    const float* lower = node.planes[0][axis];
    const float* upper = node.planes[1][axis];
    for (std::size_t slot = 0; slot < 8; ++slot) {
      const double outside = std::max(std::max(double(lower[slot]) - p, p - double(upper[slot])), 0.0);
      squared[slot] += outside * outside;
    }
  }
}

void offer_leaf(const TriangleBlock* block, std::uint32_t count, PointSink& sink) {
  for (; count != 0; --count, ++block) {
    // A block that is not full repeats its last triangle.
    for (std::size_t lane = 0; lane < 4 && (lane == 0 || block->ids[lane] != block->ids[lane - 1]); ++lane)
      sink.offer(block->ids[lane]);
  }
}

}  // namespace

// Depth first, nearer children first.
void WideBvh::search(const mesh::TriangleMesh& /*mesh*/, PointSink& sink) const {
  if (nodes().empty()) return;
  struct Entry {
    double distance;
    std::uint32_t link;
  };
  Entry stack[kWideStackSize];
  std::size_t size = 0;
  double squared[8];
  std::uint32_t link = 0;
  for (;;) {
    if (wide_child::is_leaf(link)) {
      offer_leaf(blocks().data() + wide_child::index(link), wide_child::block_count(link), sink);
    } else {
      const WideNode& node = nodes()[link];
      distances_to(node, sink.center(), squared);
      const std::size_t bottom = size;
      for (std::uint32_t slot = 0; slot < node.slots; ++slot) {
        if (squared[slot] > sink.limit()) continue;
        std::size_t place = size++;
        for (; place > bottom && stack[place - 1].distance < squared[slot]; --place)
          stack[place] = stack[place - 1];
        stack[place] = {squared[slot], node.child[slot]};
      }
    }
    do {
      if (size == 0) return;
      --size;
    } while (stack[size].distance > sink.limit());
    link = stack[size].link;
  }
}

}  // namespace gridcast::blas
