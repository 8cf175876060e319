#include <utility>

#include "core/blas/explain.h"

namespace gridcast::blas {
namespace {

struct Visit {
  std::uint32_t node;
  std::uint32_t depth;
  float s_enter;
};

/// Bvh::intersect, told step by step.
template <Precision kPrecision, Collector C>
class BvhWalk {
 public:
  BvhWalk(const Bvh& tree, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
          RayWay& way)
      : tree_(tree), mesh_(mesh), ray_(ray), collector_(collector), way_(way) {}

  void run() {
    s_far_ = ray_.cull_far(collector_.tfar());
    Visit next{0, 0, 0.F};
    if (tree_.nodes().empty() || !enter(0, next.s_enter)) return;
    stack_[size_++] = next;
    while (size_ != 0) {
      next = stack_[--size_];
      // A single child and the nearer of two are visited without asking again, which changes nothing: s_far
      // is what it was when they were found.
      if (next.s_enter > s_far_) continue;
      if (!(tree_.nodes()[next.node].leaf() ? leaf(next) : inner(next))) return;
    }
  }

 private:
  bool enter(std::uint32_t node, float& s_enter) const {
    const BvhNode& box = tree_.nodes()[node];
    return mesh::intersect_box(ray_, box.lower, box.upper, s_far_, s_enter);
  }

  bool inner(const Visit& visit) {
    const std::uint32_t first = tree_.nodes()[visit.node].first;
    Visit near{first, visit.depth + 1, 0.F};
    Visit far{first + 1, visit.depth + 1, 0.F};
    const bool hits_near = enter(near.node, near.s_enter);
    const bool hits_far = enter(far.node, far.s_enter);
    if (hits_near && hits_far && far.s_enter < near.s_enter) std::swap(near, far);
    // Without both, none or one is pushed, and the order means nothing.
    if (hits_far) stack_[size_++] = far;
    if (hits_near) stack_[size_++] = near;
    const std::uint32_t hits = std::uint32_t(hits_near) + std::uint32_t(hits_far);
    return way_.add(NodeStep{visit.node, visit.depth, t_at(ray_, visit.s_enter), 2, hits,
                             std::uint32_t(size_ - (hits != 0 ? 1 : 0))});
  }

  bool leaf(const Visit& visit) {
    const BvhNode& node = tree_.nodes()[visit.node];
    if (!way_.add(
            LeafStep{visit.node, visit.depth, t_at(ray_, visit.s_enter), node.count, std::uint32_t(size_)}))
      return false;
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const std::uint32_t id = (*tree_.primitive_ids())[i];
      const auto [p0, p1, p2] = mesh_.corners(id);
      if (!explain_triangle<kPrecision>(ray_, p0, p1, p2, id, collector_, way_)) return false;
    }
    s_far_ = ray_.cull_far(collector_.tfar());
    return true;
  }

  const Bvh& tree_;
  const mesh::TriangleMesh& mesh_;
  const mesh::ObjectRay& ray_;
  C& collector_;
  RayWay& way_;
  float s_far_ = 0.F;
  Visit stack_[kMaxBvhDepth + 2];
  std::size_t size_ = 0;
};

}  // namespace

template <Precision kPrecision, Collector C>
void explain(const Bvh& tree, const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector,
             RayWay& way) {
  BvhWalk<kPrecision, C>(tree, mesh, ray, collector, way).run();
}

GRIDCAST_INSTANTIATE_EXPLAIN(Bvh);

}  // namespace gridcast::blas
