#include <utility>

#include "core/blas/bvh.h"

namespace gridcast::blas {

// Depth first, the nearer child first, so the stack holds at most one entry a level.
void Bvh::search(const mesh::TriangleMesh& /*mesh*/, PointSink& sink) const {
  if (nodes_.empty()) return;
  struct Entry {
    double distance;
    std::uint32_t node;
  };
  Entry stack[kMaxBvhDepth + 1];
  std::size_t size = 0;
  const auto distance_to = [&](std::uint32_t node) {
    return squared_distance(sink.center(), nodes_[node].bounds());
  };
  stack[size++] = {distance_to(0), 0};
  while (size != 0) {
    const Entry next = stack[--size];
    if (next.distance > sink.limit()) continue;
    const BvhNode& node = nodes_[next.node];
    if (node.leaf()) {
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) sink.offer((*primitive_ids_)[i]);
      continue;
    }
    Entry near{distance_to(node.first), node.first};
    Entry far{distance_to(node.first + 1), node.first + 1};
    if (far.distance < near.distance) std::swap(near, far);
    stack[size++] = far;
    stack[size++] = near;
  }
}

}  // namespace gridcast::blas
