#include <bit>
#include <utility>

#include "core/blas/explain.h"
#include "core/blas/kernel_steps.h"

namespace gridcast::blas {
namespace {

struct Visit {
  float enter, exit;
  std::uint32_t link;    ///< treelet or first block
  std::uint32_t blocks;  ///< 0: a treelet
  std::uint32_t depth;

  [[nodiscard]] bool comes_before(const Visit& other) const {
    const std::int32_t a = order_of(enter), b = order_of(other.enter);
    return a != b ? a < b : link < other.link;
  }

 private:
  /// The bits, made to compare like the floats, -0 before +0.
  static std::int32_t order_of(float s) {
    const auto bits = std::bit_cast<std::int32_t>(s);
    return bits ^ ((bits >> 31) & 0x7FFFFFFF);
  }
};

/// KdTree::intersect for the closest hit, told step by step.
template <Precision kPrecision, Collector C>
class KdWalk {
 public:
  KdWalk(const KdLayout& tree, const mesh::ObjectRay& ray, C& collector, RayWay& way)
      : tree_(tree), ray_(ray), collector_(collector), way_(way) {}

  void run() {
    if (tree_.treelets.empty()) return;
    s_far_ = ray_.cull_far(collector_.tfar());
    Visit next{0.F, s_far_, 0, 0, 0};
    if (!enter_kd_root(ray_, tree_.bounds, next.enter, next.exit)) return;
    stack_[size_++] = next;
    while (size_ != 0) {
      next = stack_[--size_];
      // The kernel asks only of what has waited; what was just found passes anyway.
      if (next.enter > s_far_) continue;
      if (!(next.blocks == 0 ? inner(next) : leaf(next))) return;
    }
  }

 private:
  static Visit child_of(const KdTreelet& treelet, std::uint32_t slot, const SlotSegments& segments,
                        std::uint32_t depth) {
    return {segments.enter[slot], segments.exit[slot],
            treelet.is_inner(slot) ? treelet.child(slot) : treelet.block(slot), treelet.block_count(slot),
            depth};
  }

  bool inner(const Visit& visit) {
    const KdTreelet& treelet = tree_.treelets[visit.link];
    SlotSegments segments;
    const std::uint32_t hits =
        enter_treelet(treelet, ray_, visit.enter, std::min(visit.exit, s_far_), segments);
    const std::uint32_t stack = push(treelet, hits, segments, visit.depth + 1);
    return way_.add(NodeStep{visit.link, visit.depth, t_at(ray_, visit.enter),
                             std::uint32_t(std::popcount(treelet.used)), std::uint32_t(std::popcount(hits)),
                             stack});
  }

  /// Puts the children on the stack, the nearest on top; returns how many wait while that is visited. Where
  /// two are entered at once and have the same link, the order is that of the kernel.
  std::uint32_t push(const KdTreelet& treelet, std::uint32_t hits, const SlotSegments& segments,
                     std::uint32_t depth) {
    if (hits == 0) return std::uint32_t(size_);
    Visit nearest = child_of(treelet, std::uint32_t(std::countr_zero(hits)), segments, depth);
    const std::size_t bottom = size_;
    for (hits &= hits - 1; hits != 0; hits &= hits - 1) {
      Visit other = child_of(treelet, std::uint32_t(std::countr_zero(hits)), segments, depth);
      if (other.comes_before(nearest)) std::swap(other, nearest);
      std::size_t place = size_++;
      for (; place > bottom && stack_[place - 1].comes_before(other); --place)
        stack_[place] = stack_[place - 1];
      stack_[place] = other;
    }
    stack_[size_++] = nearest;
    return std::uint32_t(size_ - 1);
  }

  bool leaf(const Visit& visit) {
    std::uint32_t triangles = 0;
    for (std::uint32_t b = visit.link; b < visit.link + visit.blocks; ++b)
      triangles += tree_.blocks[b].size();
    if (!way_.add(
            LeafStep{visit.link, visit.depth, t_at(ray_, visit.enter), triangles, std::uint32_t(size_)}))
      return false;
    const float s_exit = std::min(visit.exit, s_far_);
    for (std::uint32_t b = visit.link; b < visit.link + visit.blocks; ++b)
      if (!test(tree_.blocks[b], s_exit)) return false;
    s_far_ = ray_.cull_far(collector_.tfar());
    return true;
  }

  bool test(const KdBlock& block, float s_exit) {
    TriangleBlock columns;
    for (std::size_t lane = 0; lane < 4; ++lane)
      for (std::size_t corner = 0; corner < 3; ++corner)
        for (std::size_t axis = 0; axis < 3; ++axis)
          columns.corners[corner][axis][lane] =
              tree_.triangles[block.triangles[lane]].corners[3 * corner + axis];
    const std::uint32_t possible = filter_triangles<kPrecision>(columns, ray_, s_exit);
    for (std::uint32_t lane = 0; lane < block.size(); ++lane) {
      const KdTriangle& triangle = tree_.triangles[block.triangles[lane]];
      const bool goes_on =
          ((possible >> lane) & 1U) != 0
              ? explain_triangle<kPrecision>(ray_, triangle.corner(0), triangle.corner(1), triangle.corner(2),
                                             triangle.id, collector_, way_)
              : way_.add(TriangleStep{triangle.id, TriangleVerdict::kFiltered, false, std::nullopt});
      if (!goes_on) return false;
    }
    return true;
  }

  const KdLayout& tree_;
  const mesh::ObjectRay& ray_;
  C& collector_;
  RayWay& way_;
  float s_far_ = 0.F;
  Visit stack_[kKdStackSize + 1];
  std::size_t size_ = 0;
};

}  // namespace

template <Precision kPrecision, Collector C>
void explain(const KdTree& tree, const mesh::TriangleMesh& /*mesh*/, const mesh::ObjectRay& ray, C& collector,
             RayWay& way) {
  KdWalk<kPrecision, C>(tree.layout(), ray, collector, way).run();
}

GRIDCAST_INSTANTIATE_EXPLAIN(KdTree);

}  // namespace gridcast::blas
