// Several rays on their way through wide trees at the same time. Included once per instruction set by the
// kernels (see hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_BLAS_STREAM_WALK_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_STREAM_WALK_INL_H
#undef GRIDCAST_BLAS_STREAM_WALK_INL_H
#else
#define GRIDCAST_BLAS_STREAM_WALK_INL_H
#endif

#include <cstddef>
#include <cstdint>
#include <limits>
#include <new>
#include <utility>

#include <hwy/highway.h>

#include "core/blas/child_order-inl.h"
#include "core/blas/ray_stream.h"
#include "core/blas/wide_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

#if HWY_TARGET <= HWY_AVX3 && HWY_ARCH_X86

/// One ray between two of its steps, which are those of traverse(): its next node or block, and what waits.
template <Precision kPrecision, Collector C>
class StreamWalker {
 public:
  /// Of a ray that has nothing left to visit.
  static constexpr std::uint32_t kEnd = 0xFFFFFFFFU;

  HWY_INLINE StreamWalker(const WideView& tree, const mesh::ObjectRay& ray, C& collector)
      : tree_(tree),
        ray_(ray),
        collector_(collector),
        s_far_(ray.cull_far(collector.tfar())),
        last_(far_entry(s_far_)) {
    *top_ = std::numeric_limits<StackEntry>::min() | StackEntry(kEnd);
  }
  StreamWalker(const StreamWalker&) = delete;
  StreamWalker& operator=(const StreamWalker&) = delete;

  [[nodiscard]] HWY_INLINE std::uint32_t link() const { return link_; }
  [[nodiscard]] HWY_INLINE bool found() const { return found_; }

  /// Tests the children of a node and goes on to the nearest, or to what waits.
  HWY_INLINE void go_down() {
    const StackEntry below = *top_;
    const PushedChildren pushed = push_children<!C::kStopsAtFirst>(tree_.nodes[link_], ray_, s_far_, top_);
    top_ -= pushed.count;
    ++top_;
    go_to(pushed.count != 0 ? pushed.first : below);
  }
  /// The filter of the first block of a leaf; decide() acts on it.
  HWY_INLINE void look_at_block() {
    filtered_ = filter_block<kPrecision, kCertainFor<C>, EarlyOut::kNo>(block(), ray_.block, s_far_);
  }
  /// Goes on to the next block or to what waits. The second block of a leaf is a leaf of its own then.
  HWY_INLINE void decide() {
    if ((filtered_.certain | filtered_.possible) != 0) {
      const Offer offer = decide_block<kPrecision>(tree_.blocks, block(), filtered_, ray_.ray, collector_);
      if (offer != Offer::kGoOn) {
        found_ = true;
        if (offer == Offer::kDone) {
          link_ = kEnd;
          return;
        }
        s_far_ = ray_.ray.cull_far(collector_.tfar());
        last_ = far_entry(s_far_);
      }
    }
    if (wide_child::block_count(link_) == 1)
      pop();
    else
      link_ = wide_child::leaf(wide_child::index(link_) + 1, 1);
  }

 private:
  [[nodiscard]] HWY_INLINE const TriangleBlock& block() const {
    return tree_.blocks[wide_child::index(link_)];
  }
  HWY_INLINE void pop() { go_to(*top_++); }
  /// To this entry or, where it is beyond the range, to the first that is not.
  HWY_INLINE void go_to(StackEntry next) {
    if constexpr (!C::kStopsAtFirst)
      while (next > last_) next = *top_++;
    link_ = std::uint32_t(next);
    if (link_ != kEnd) prefetch(tree_, link_);
  }
  const WideView tree_;
  const WideRay ray_;
  C& collector_;
  float s_far_;
  StackEntry last_;
  std::uint32_t link_ = 0;
  BlockHits filtered_{};
  bool found_ = false;
  StackEntry* top_ = stack_ + kWideStackSize;
  /// Grows down from an end mark; eight entries are written at a time, which reach beyond the mark.
  StackEntry stack_[kWideStackSize + 8];
};

/// Moves every ray by a step, over and over. What one ray's step waits for does not hold up the others', a
/// branch that was foreseen wrongly costs little, as what it asks for was found before, and what a ray needs
/// next comes from memory while the others move.
template <Precision kPrecision, Collector C>
class StreamWalk {
 public:
  /// `tree` has a node; all must outlive the walk. At most kStreamSize rays.
  HWY_INLINE void add(const WideView& tree, const mesh::ObjectRay& ray, C& collector) {
    new (memory_[count_]) Walker(tree, ray, collector);
    at_nodes_[node_count_++] = count_++;
  }

  /// Hits by the order in which rays were added.
  HWY_INLINE StreamResult run() {
    while (node_count_ + leaf_count_ != 0) {
      move_nodes();
      move_leaves();
    }
    std::uint32_t found = 0;
    for (std::uint32_t i = 0; i < count_; ++i) found |= std::uint32_t(walker(i).found()) << i;
    return {found, steps_};
  }

 private:
  using Walker = StreamWalker<kPrecision, C>;

  [[nodiscard]] HWY_INLINE Walker& walker(std::uint32_t i) {
    void* at = memory_[i];
    return *std::launder(static_cast<Walker*>(at));
  }
  HWY_INLINE void move_nodes() {
    const std::uint32_t count = std::exchange(node_count_, 0);
    steps_ += count;
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t i = at_nodes_[k];
      walker(i).go_down();
      place(i);
    }
  }
  HWY_INLINE void move_leaves() {
    const std::uint32_t count = std::exchange(leaf_count_, 0);
    steps_ += count;
    for (std::uint32_t k = 0; k < count; ++k) walker(at_leaves_[k]).look_at_block();
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t i = at_leaves_[k];
      walker(i).decide();
      place(i);
    }
  }
  /// Without a branch: whether a ray comes to a node or a leaf is hard to foresee. A list is at most as long
  /// as what was read of it.
  HWY_INLINE void place(std::uint32_t i) {
    const std::uint32_t link = walker(i).link();
    const std::uint32_t leaf = link >> 31U;
    at_nodes_[node_count_] = i;
    node_count_ += 1 - leaf;
    at_leaves_[leaf_count_] = i;
    leaf_count_ += leaf & std::uint32_t(link != Walker::kEnd);
  }

  alignas(Walker) std::byte memory_[kStreamSize][sizeof(Walker)];
  std::uint32_t at_nodes_[kStreamSize + 1], at_leaves_[kStreamSize + 1];
  std::uint32_t count_ = 0, node_count_ = 0, leaf_count_ = 0;
  std::uint32_t steps_ = 0;
};

#else

/// One ray after the other: without AVX-512 steps that take turns cost as much as they save.
template <Precision kPrecision, Collector C>
class StreamWalk {
 public:
  HWY_INLINE void add(const WideView& tree, const mesh::ObjectRay& ray, C& collector) {
    const CountedSteps counted{result_.steps};
    result_.hits |= std::uint32_t(traverse<kPrecision>(tree, ray, collector, counted)) << count_++;
  }
  [[nodiscard]] HWY_INLINE StreamResult run() const { return result_; }

 private:
  struct CountedSteps {
    std::uint32_t& steps;
    HWY_INLINE void operator()() const { ++steps; }
  };
  StreamResult result_;
  std::uint32_t count_ = 0;
};

#endif

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
