// The walk through the grid, compiled once per instruction set and chosen at run time by Highway. All of it
// only culls, so the instruction set does not change an answer.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/tlas/grid_traversal.cpp"  // NOLINT: Highway includes this file once per target

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/tlas/box_tester-inl.h"
#include "core/tlas/grid_walk.h"
#include "core/tlas/kernel_steps.h"
#include "core/tlas/uniform_grid.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::tlas::HWY_NAMESPACE {

/// One ray on its way: what the cells have in common.
class CellTester {
 public:
  HWY_INLINE CellTester(const GridRay& ray, double far, const InstanceVisitor& visitor)
      : ray_(ray), boxes_(ray), visitor_(visitor), far_(far), s_far_(ray.s_far(far)) {}
  [[nodiscard]] double far() const { return far_; }

  HWY_INLINE void test(GridBlock::CellStart cell, int from) {
    if (cell.kind == CellKind::kTree) {
      test_tree(cell.groups, from);
    } else {
      test_flat(cell, from);
    }
  }

 private:
  void visit(std::uint32_t id) {
    const double far = visitor_.visit(visitor_.object, id);
    if (far == far_) return;
    far_ = far;
    s_far_ = ray_.s_far(far);
  }

  /// The instances of these slots, nearest first, as long as they can matter.
  HWY_INLINE void visit_slots(std::uint32_t hits, const std::uint32_t* ids, const float* s_enter) {
    if ((hits & (hits - 1)) == 0) {
      visit(ids[__builtin_ctz(hits)]);
      return;
    }
    for (std::uint32_t rest = hits; rest != 0; rest &= rest - 1)
      visitor_.prefetch(visitor_.object, ids[__builtin_ctz(rest)]);
    while (hits != 0) {
      auto nearest = std::uint32_t(__builtin_ctz(hits));
      for (std::uint32_t rest = hits & (hits - 1); rest != 0; rest &= rest - 1) {
        const auto slot = std::uint32_t(__builtin_ctz(rest));
        if (s_enter[slot] < s_enter[nearest]) nearest = slot;
      }
      if (s_enter[nearest] > s_far_) return;
      hits &= ~(1U << nearest);
      visit(ids[nearest]);
    }
  }

  HWY_INLINE void test_flat(GridBlock::CellStart cell, int from) {
    alignas(32) float s_enter[8];
    const std::byte* at = cell.groups;
    NextGroup next = cell.kind == CellKind::kFour ? NextGroup::kFour : NextGroup::kEight;
    while (next != NextGroup::kNone) {
      if (next == NextGroup::kFour) {
        const auto& group = group_at<4>(at);
        const std::uint32_t hits = boxes_.enter(group, s_far_, s_enter) & ~std::uint32_t(group.seen[from]);
        if (hits != 0) visit_slots(hits, group.links, s_enter);
        at += sizeof(BoxGroup<4>);
        next = group.next;
      } else {
        const auto& group = group_at<8>(at);
        const std::uint32_t hits = boxes_.enter(group, s_far_, s_enter) & ~std::uint32_t(group.seen[from]);
        if (hits != 0) visit_slots(hits, group.links, s_enter);
        at += sizeof(BoxGroup<8>);
        next = group.next;
      }
    }
  }

  // The stack holds what is still to visit, nearest on top. Entries of one node are inserted in order.
  void test_tree(const std::byte* groups, int from) {
    std::int64_t stack[kStackSize];
    std::size_t size = 0;
    alignas(32) float s_enter[8];
    std::uint32_t link = 0;
    for (;;) {
      const auto& group = group_at<8>(groups + std::size_t(tree_link::index(link)) * sizeof(BoxGroup<8>));
      std::uint32_t hits = boxes_.enter(group, s_far_, s_enter) & ~std::uint32_t(group.seen[from]);
      if (tree_link::is_leaf(link)) {
        if (hits != 0) visit_slots(hits, group.links, s_enter);
      } else {
        const std::size_t bottom = size;
        for (; hits != 0; hits &= hits - 1) {
          const auto slot = std::uint32_t(__builtin_ctz(hits));
          const std::int64_t entry = stack_entry(s_enter[slot], group.links[slot]);
          std::size_t place = size++;
          for (; place > bottom && stack[place - 1] < entry; --place) stack[place] = stack[place - 1];
          stack[place] = entry;
        }
      }
      const std::int64_t far_entry = stack_entry(s_far_, 0xFFFFFFFFU);
      do {
        if (size == 0) return;
        --size;
      } while (stack[size] > far_entry);
      link = std::uint32_t(stack[size]);
    }
  }

  const GridRay& ray_;
  BoxTester boxes_;
  const InstanceVisitor& visitor_;
  double far_;
  float s_far_;
};

// Blocks without instances are left at once. The walk goes on as long as something nearer than the best hit
// may come: whatever is still to come is hit at t_enter of the next cell or later.
// A cell that is entered at the best hit's very t need not be looked at: the segment of the cell before ends
// there, and is closed, so the cell before lists every instance with a hit at that t, too (GridWalk), and has
// offered it. Only the first cell has none before it, and is entered at the best hit's t where the range is a
// single t.
double walk(const UniformGrid& grid, const WorldRay& world, double far, const InstanceVisitor& visitor) {
  GridWalk walk(grid.layout(), world, far);
  if (walk.done()) return far;
  const GridRay ray(grid.layout(), world, walk.start(), walk.end());
  CellTester cells(ray, far, visitor);
  while (!walk.done() && walk.t_enter() <= cells.far()) {
    const GridBlock* block = grid.block(walk.block());
    if (block == nullptr) {
      walk.leave_block();
      continue;
    }
    do {
      const std::uint32_t local = walk.local();
      if (block->occupied(local)) cells.test(block->cell(local), walk.from());
    } while (walk.step() && walk.t_enter() <= cells.far());
  }
  return cells.far();
}

/// For enter_group.
template <std::size_t kSlots>
std::uint32_t enter_once(const BoxGroup<kSlots>& group, const GridRay& ray, double far, GroupEntries& out) {
  return BoxTester(ray).enter(group, ray.s_far(far), out.s_enter);
}
std::uint32_t enter_four(const BoxGroup<4>& group, const GridRay& ray, double far, GroupEntries& out) {
  return enter_once(group, ray, far, out);
}
std::uint32_t enter_eight(const BoxGroup<8>& group, const GridRay& ray, double far, GroupEntries& out) {
  return enter_once(group, ray, far, out);
}

}  // namespace gridcast::tlas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::tlas {

HWY_EXPORT(walk);
HWY_EXPORT(enter_four);
HWY_EXPORT(enter_eight);

double UniformGrid::walk(const WorldRay& ray, double far, const InstanceVisitor& visitor) const {
  return HWY_DYNAMIC_DISPATCH(walk)(*this, ray, far, visitor);
}

std::uint32_t enter_group(const BoxGroup<4>& group, const GridRay& ray, double far, GroupEntries& entries) {
  return HWY_DYNAMIC_DISPATCH(enter_four)(group, ray, far, entries);
}
std::uint32_t enter_group(const BoxGroup<8>& group, const GridRay& ray, double far, GroupEntries& entries) {
  return HWY_DYNAMIC_DISPATCH(enter_eight)(group, ray, far, entries);
}

}  // namespace gridcast::tlas
#endif
