#pragma once
// The walk that explains a tree of eight children a node, whatever its layout.

#include <bit>

#include "core/blas/explain.h"
#include "core/blas/kernel_steps.h"
#include "core/blas/wide_view.h"

namespace gridcast::blas {

struct WideVisit {
  std::int32_t s_enter_bits;  ///< compare like the float, which is not negative
  std::uint32_t link;
  std::uint32_t depth;

  [[nodiscard]] bool comes_before(const WideVisit& other) const {
    return s_enter_bits != other.s_enter_bits ? s_enter_bits < other.s_enter_bits : link < other.link;
  }
};

/// intersect() of the structure for the closest hit, told step by step.
template <Precision kPrecision, class View, Collector C>
class WideWalk {
 public:
  WideWalk(const View& tree, const mesh::ObjectRay& ray, C& collector, RayWay& way)
      : tree_(tree), ray_(ray), collector_(collector), way_(way) {}

  void run() {
    s_far_ = ray_.cull_far(collector_.tfar());
    stack_[size_++] = {0, 0, 0};
    bool is_root = true;
    while (size_ != 0) {
      const WideVisit next = stack_[--size_];
      // The kernel asks only of what has waited; a child that was just found passes anyway, and the root has
      // no box.
      if (!is_root && next.s_enter_bits > std::bit_cast<std::int32_t>(s_far_)) continue;
      is_root = false;
      if (!(wide_child::is_leaf(next.link) ? leaf(next) : inner(next))) return;
    }
  }

 private:
  [[nodiscard]] double t_enter(const WideVisit& visit) const {
    return t_at(ray_, std::bit_cast<float>(visit.s_enter_bits));
  }

  bool inner(const WideVisit& visit) {
    const auto& node = tree_.nodes[visit.link];
    SlotEntries entries;
    const std::uint32_t hits = enter_node(node, ray_, s_far_, entries);
    const std::size_t bottom = size_;
    for (std::uint32_t rest = hits; rest != 0; rest &= rest - 1) {
      const auto slot = std::uint32_t(std::countr_zero(rest));
      const WideVisit child{entries.s_enter_bits[slot], tree_.child(node, slot), visit.depth + 1};
      std::size_t place = size_++;
      for (; place > bottom && stack_[place - 1].comes_before(child); --place)
        stack_[place] = stack_[place - 1];
      stack_[place] = child;
    }
    return way_.add(NodeStep{visit.link, visit.depth, t_enter(visit), tree_.slot_count(node),
                             std::uint32_t(std::popcount(hits)), std::uint32_t(size_ - (hits != 0 ? 1 : 0))});
  }

  bool leaf(const WideVisit& visit) {
    std::uint32_t triangles = 0;
    tree_.for_blocks(visit.link, [&](const TriangleBlock& block) {
      triangles += triangles_in(block);
      return true;
    });
    const std::uint32_t number = tree_.leaf_number(visit.link);
    if (!way_.add(LeafStep{number, visit.depth, t_enter(visit), triangles, std::uint32_t(size_)}))
      return false;
    if (!tree_.for_blocks(visit.link, [this](const TriangleBlock& block) { return test(block); }))
      return false;
    s_far_ = ray_.cull_far(collector_.tfar());
    return true;
  }

  bool test(const TriangleBlock& block) {
    const std::uint32_t possible = filter_triangles<kPrecision>(block, ray_, s_far_);
    for (std::uint32_t lane = 0; lane < triangles_in(block); ++lane) {
      const bool goes_on =
          ((possible >> lane) & 1U) != 0
              ? explain_triangle<kPrecision>(ray_, block.corner(0, lane), block.corner(1, lane),
                                             block.corner(2, lane), block.ids[lane], collector_, way_)
              : way_.add(TriangleStep{block.ids[lane], TriangleVerdict::kFiltered, false, std::nullopt});
      if (!goes_on) return false;
    }
    return true;
  }

  View tree_;
  const mesh::ObjectRay& ray_;
  C& collector_;
  RayWay& way_;
  float s_far_ = 0.F;
  WideVisit stack_[kWideStackSize];
  std::size_t size_ = 0;
};

}  // namespace gridcast::blas
