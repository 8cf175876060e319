// A group of rays through the grid, compiled once per instruction set and chosen at run time by Highway. As
// in the walk of one ray all of it only culls.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/tlas/group_traversal.cpp"  // NOLINT: Highway includes this file once per target

#include <limits>
#include <memory>
#include <new>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/tlas/box_tester-inl.h"
#include "core/tlas/grid_walk.h"
#include "core/tlas/group_visitor.h"
#include "core/tlas/uniform_grid.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::tlas::HWY_NAMESPACE {

/// The walk of one ray (grid_traversal.cpp) that pauses at every instance: it visits the same ones, in the
/// same order. It also pauses before it reads a block or the boxes of a cell, which are asked for first.
class PausingWalk {
 public:
  HWY_INLINE PausingWalk(const UniformGrid& grid, const WorldRay& world, const GridWalk& walk, double far)
      : grid_(grid),
        walk_(walk),
        ray_(grid.layout(), world, walk.start(), walk.end()),
        boxes_(ray_),
        far_(far),
        s_far_(ray_.s_far(far)) {}
  PausingWalk(const PausingWalk&) = delete;  // boxes_ points into it
  PausingWalk& operator=(const PausingWalk&) = delete;

  /// Why the walk does not go on at once; kMemory: what it needs next is on its way.
  enum class Pause : std::uint8_t { kEnd, kInstance, kMemory };

  /// Goes on towards t = far. Sets `id` at an instance.
  HWY_INLINE Pause next(double far, std::uint32_t& id) {
    if (far != far_) {
      far_ = far;
      s_far_ = ray_.s_far(far);
    }
    for (;;) {
      if (hits_ != 0 && take_nearest(id)) return Pause::kInstance;
      const bool more = kind_ == CellKind::kTree ? next_leaf() : next_group();
      if (more) continue;
      return next_cell() ? Pause::kMemory : Pause::kEnd;
    }
  }

 private:
  HWY_INLINE bool take_nearest(std::uint32_t& id) {
    auto nearest = std::uint32_t(__builtin_ctz(hits_));
    for (std::uint32_t rest = hits_ & (hits_ - 1); rest != 0; rest &= rest - 1) {
      const auto slot = std::uint32_t(__builtin_ctz(rest));
      if (s_enter_[slot] < s_enter_[nearest]) nearest = slot;
    }
    if (s_enter_[nearest] > s_far_) {
      hits_ = 0;
      return false;
    }
    hits_ &= ~(1U << nearest);
    id = ids_[nearest];
    return true;
  }

  template <std::size_t kSlots>
  HWY_INLINE void enter(const BoxGroup<kSlots>& group) {
    hits_ = boxes_.enter(group, s_far_, s_enter_) & ~std::uint32_t(group.seen[walk_.from()]);
    ids_ = group.links;
  }

  /// The next boxes of a cell that is a list; false when there are none.
  HWY_INLINE bool next_group() {
    if (next_ == NextGroup::kNone) return false;
    if (next_ == NextGroup::kFour) {
      const auto& group = group_at<4>(groups_);
      enter(group);
      groups_ += sizeof(BoxGroup<4>);
      next_ = group.next;
    } else {
      const auto& group = group_at<8>(groups_);
      enter(group);
      groups_ += sizeof(BoxGroup<8>);
      next_ = group.next;
    }
    return true;
  }

  /// The next leaf of a cell that is a tree; false when there is none.
  HWY_INLINE bool next_leaf() {
    const std::int64_t far_entry = stack_entry(s_far_, 0xFFFFFFFFU);
    while (size_ != 0) {
      const std::int64_t top = stack_[--size_];
      if (top > far_entry) continue;
      const auto link = std::uint32_t(top);
      const auto& group = group_at<8>(groups_ + std::size_t(tree_link::index(link)) * sizeof(BoxGroup<8>));
      enter(group);
      if (tree_link::is_leaf(link)) return true;
      push_children(group);
    }
    return false;
  }

  HWY_INLINE void push_children(const BoxGroup<8>& group) {
    const std::size_t bottom = size_;
    for (; hits_ != 0; hits_ &= hits_ - 1) {
      const auto slot = std::uint32_t(__builtin_ctz(hits_));
      const std::int64_t entry = stack_entry(s_enter_[slot], group.links[slot]);
      std::size_t place = size_++;
      for (; place > bottom && stack_[place - 1] < entry; --place) stack_[place] = stack_[place - 1];
      stack_[place] = entry;
    }
  }

  /// To the next block or the next cell that holds something; false when there is none.
  HWY_INLINE bool next_cell() {
    for (;;) {
      if (block_ != nullptr && cell_done_ && !walk_.step()) block_ = nullptr;
      cell_done_ = true;
      if (walk_.done() || !(walk_.t_enter() <= far_)) return false;
      if (block_ == nullptr) {
        block_ = grid_.block(walk_.block());
        if (block_ == nullptr) {
          walk_.leave_block();
          continue;
        }
        prefetch(block_, 2);
        cell_done_ = false;
        return true;
      }
      const std::uint32_t local = walk_.local();
      if (!block_->occupied(local)) continue;
      start(block_->cell(local));
      return true;
    }
  }

  static HWY_INLINE void prefetch(const void* at, std::size_t lines) {
    const auto* line = static_cast<const std::byte*>(at);
    for (std::size_t i = 0; i < lines; ++i) __builtin_prefetch(line + i * GridBlock::kLineBytes);
  }

  HWY_INLINE void start(const GridBlock::CellStart& cell) {
    kind_ = cell.kind;
    groups_ = cell.groups;
    next_ = cell.kind == CellKind::kFour ? NextGroup::kFour : NextGroup::kEight;
    prefetch(groups_, cell.kind == CellKind::kFour ? 2 : 4);
    if (cell.kind != CellKind::kTree) return;
    stack_[0] = stack_entry(-std::numeric_limits<float>::infinity(), 0);
    size_ = 1;
  }

  const UniformGrid& grid_;
  GridWalk walk_;
  GridRay ray_;
  BoxTester boxes_;
  double far_;
  float s_far_;
  const GridBlock* block_ = nullptr;  ///< of the cell where the walk is; null: not known yet
  bool cell_done_ = false;            ///< nothing is left to start in the cell

  // What is left of the cell: slots of the group that was tested last, and groups.
  std::uint32_t hits_ = 0;
  CellKind kind_ = CellKind::kFour;
  NextGroup next_ = NextGroup::kNone;
  const std::uint32_t* ids_ = nullptr;
  const std::byte* groups_ = nullptr;
  alignas(32) float s_enter_[8];
  std::size_t size_ = 0;
  std::int64_t stack_[kStackSize];
};

/// Memory for the walks of a group: most of a walk is a stack that is seldom used, so nothing is set before.
struct WalkMemory {
  alignas(PausingWalk) std::byte bytes[kGroupSize][sizeof(PausingWalk)];

  [[nodiscard]] PausingWalk& operator[](std::size_t i) {
    void* at = bytes[i];
    return *std::launder(static_cast<PausingWalk*>(at));
  }
};

/// All rays go to their next pause, then those at the same instance visit it together, over and over. What a
/// ray needs next is on its way from memory while the others move: "Rendering Complex Scenes with
/// Memory-Coherent Ray Tracing", M. Pharr, 1997, lets rays wait for what they need; here they wait for lines
/// of the cache, and a few at a time, so that nothing has to be put in queues.
class GroupWalk {
 public:
  HWY_INLINE GroupWalk(const UniformGrid& grid, const WorldRay* worlds, std::uint32_t rays, double* far,
                       const GroupVisitor& visitor)
      : far_(far), visitor_(visitor) {
    for (; rays != 0; rays &= rays - 1) {
      const auto i = std::uint32_t(__builtin_ctz(rays));
      const GridWalk walk(grid.layout(), worlds[i], far[i]);
      if (walk.done()) continue;
      new (walks_.bytes[i]) PausingWalk(grid, worlds[i], walk, far[i]);
      going_ |= 1U << i;
    }
  }

  HWY_INLINE void run() {
    while (going_ != 0)
      if (const std::uint32_t arrived = move(); arrived != 0) visit(arrived);
  }

 private:
  /// Every ray to its next pause; returns those that are at an instance.
  HWY_INLINE std::uint32_t move() {
    std::uint32_t arrived = 0;
    for (std::uint32_t rest = going_; rest != 0; rest &= rest - 1) {
      const auto i = std::uint32_t(__builtin_ctz(rest));
      switch (walks_[i].next(far_[i], ids_[i])) {
        case PausingWalk::Pause::kInstance:
          visitor_.prefetch(visitor_.object, ids_[i]);
          arrived |= 1U << i;
          break;
        case PausingWalk::Pause::kEnd:
          going_ &= ~(1U << i);
          break;
        case PausingWalk::Pause::kMemory:
          break;
      }
    }
    return arrived;
  }

  HWY_INLINE void visit(std::uint32_t arrived) {
    while (arrived != 0) {
      const std::uint32_t id = ids_[__builtin_ctz(arrived)];
      std::uint32_t together = 0;
      for (std::uint32_t rest = arrived; rest != 0; rest &= rest - 1) {
        const auto i = std::uint32_t(__builtin_ctz(rest));
        together |= std::uint32_t(ids_[i] == id) << i;
      }
      visitor_.visit(visitor_.object, id, together, far_);
      arrived &= ~together;
    }
    visitor_.finish(visitor_.object, far_);
  }

  double* far_;
  const GroupVisitor& visitor_;
  WalkMemory walks_;
  std::uint32_t ids_[kGroupSize];
  std::uint32_t going_ = 0;  ///< a bit for each ray that is not at its end
};

void walk_group(const UniformGrid& grid, const WorldRay* worlds, std::uint32_t rays, double* far,
                const GroupVisitor& visitor) {
  GroupWalk(grid, worlds, rays, far, visitor).run();
}

}  // namespace gridcast::tlas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::tlas {

HWY_EXPORT(walk_group);

void UniformGrid::walk_group(const WorldRay* worlds, std::uint32_t rays, double* far,
                             const GroupVisitor& visitor) const {
  HWY_DYNAMIC_DISPATCH(walk_group)(*this, worlds, rays, far, visitor);
}

}  // namespace gridcast::tlas
#endif
