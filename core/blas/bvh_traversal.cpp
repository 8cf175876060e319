#include <utility>

#include "core/blas/bvh.h"

namespace gridcast::blas {
namespace {

struct StackEntry {
  std::uint32_t node;
  float s_enter;
};

}  // namespace

// Depth first, the nearer child first. Every inner node on the way down leaves at most one entry, so
// the stack never holds more than the depth of the tree, which the builder bounds.
//
// A node is skipped only when it starts strictly beyond s_far: one that starts at the same distance may hold
// a hit at the same t with a smaller id.
template <Precision kPrecision, Collector C>
bool Bvh::intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const {
  if (nodes_.empty()) return false;
  const BvhNode* const nodes = nodes_.data();
  const std::uint32_t* const ids = primitive_ids_->data();
  StackEntry stack[kMaxBvhDepth];
  std::size_t stack_size = 0;
  bool narrowed = false;
  float s_far = ray.cull_far(collector.tfar());
  float s_enter;
  if (!mesh::intersect_box(ray, nodes[0].lower, nodes[0].upper, s_far, s_enter)) return false;

  const BvhNode* node = nodes;
  for (;;) {
    if (!node->leaf()) {
      const BvhNode* near = nodes + node->first;
      const BvhNode* far = near + 1;
      float s_near;
      float s_second;
      const bool hits_near = mesh::intersect_box(ray, near->lower, near->upper, s_far, s_near);
      const bool hits_far = mesh::intersect_box(ray, far->lower, far->upper, s_far, s_second);
      if (hits_near && hits_far) {
        if (s_second < s_near) {
          std::swap(near, far);
          std::swap(s_near, s_second);
        }
        stack[stack_size++] = {std::uint32_t(far - nodes), s_second};
        node = near;
        continue;
      }
      if (hits_near || hits_far) {
        node = hits_near ? near : far;
        continue;
      }
    } else {
      bool narrowed_here = false;
      for (std::uint32_t i = node->first; i < node->first + node->count; ++i) {
        const std::uint32_t id = ids[i];
        const auto [p0, p1, p2] = mesh.corners(id);
        const Offer offer = test_triangle<kPrecision>(ray, p0, p1, p2, id, collector);
        if (offer == Offer::kDone) return true;
        narrowed_here |= offer == Offer::kNarrowed;
      }
      if (narrowed_here) {
        narrowed = true;
        s_far = ray.cull_far(collector.tfar());
      }
    }
    do {
      if (stack_size == 0) return narrowed;
      --stack_size;
    } while (stack[stack_size].s_enter > s_far);
    node = nodes + stack[stack_size].node;
  }
}

template bool Bvh::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                               ClosestHit&) const;
template bool Bvh::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                               AnyHit&) const;
template bool Bvh::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                               HitSink&) const;
template bool Bvh::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                 ClosestHit&) const;
template bool Bvh::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                 AnyHit&) const;
template bool Bvh::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                 HitSink&) const;
template bool Bvh::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                ExactClosest&) const;
template bool Bvh::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                ExactAny&) const;

}  // namespace gridcast::blas
