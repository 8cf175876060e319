// The traversal of trees with eight children a node, for whatever lays out their nodes and leaves. Included
// once per instruction set by the traversal kernels (see hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_BLAS_WIDE_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_WIDE_KERNEL_INL_H
#undef GRIDCAST_BLAS_WIDE_KERNEL_INL_H
#else
#define GRIDCAST_BLAS_WIDE_KERNEL_INL_H
#endif

#include <bit>

#include <hwy/highway.h>

#include "core/blas/block_filter-inl.h"
#include "core/blas/view_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

/// A node or leaf to visit: the bits of its s_enter, which order like the float as it is not negative, and
/// its link.
using StackEntry = std::int64_t;

HWY_INLINE StackEntry entry(std::int32_t s_enter_bits, std::uint32_t link) {
  return (std::int64_t(s_enter_bits) << 32) | std::int64_t(link);
}
/// Above every entry that is entered at s_far or before.
HWY_INLINE StackEntry far_entry(float s_far) {
  return entry(std::bit_cast<std::int32_t>(s_far), 0xFFFFFFFFU);
}

/// The ray, and which planes are near.
struct WideRay {
  using D8 = hn::CappedTag<float, 8>;
  /// Places from the lower planes of an axis to the upper ones, and from an axis to the next.
  static constexpr std::size_t kUpper = 24, kAxis = 8;

  explicit HWY_INLINE WideRay(const mesh::ObjectRay& r)
      : ray(r),
        block(r),
        x(upper(r.inverse_direction.x)),
        y(kAxis + upper(r.inverse_direction.y)),
        z(2 * kAxis + upper(r.inverse_direction.z)) {}

  const mesh::ObjectRay& ray;
  BlockRay block;
  std::size_t x, y, z;  ///< where the near planes of an axis are; the far ones are opposite(axis)

  [[nodiscard]] static HWY_INLINE std::size_t opposite(std::size_t axis, std::size_t near) {
    return kUpper + 2 * kAxis * axis - near;
  }

 private:
  static HWY_INLINE std::size_t upper(float inverse) {
    return (std::bit_cast<std::uint32_t>(inverse) >> 31U) * kUpper;
  }
};

/// Slab test of slots from `first` on: the bits of s_enter of each, and of where it is left. Integers compare
/// like the floats here, in fewer cycles: a negative distance is below every other, whatever its size, and
/// loses against the 0 of the start or fails as an exit. A slot may be hit unless it is left before it is
/// entered.
template <class Node>
HWY_INLINE void slab_test(const Node& node, const WideRay& r, float s_far, std::size_t first,
                          hn::Vec<hn::RebindToSigned<WideRay::D8>>& enter,
                          hn::Vec<hn::RebindToSigned<WideRay::D8>>& exit) {
  const WideRay::D8 d;
  const hn::RebindToSigned<WideRay::D8> di;
  const mesh::ObjectRay& ray = r.ray;
  const auto slab = [&](int axis, std::size_t place, float offset) HWY_ATTR {
    return hn::BitCast(di, hn::MulAdd(planes_of(d, node, axis, place + first),
                                      hn::Set(d, ray.inverse_direction[axis]), hn::Set(d, offset)));
  };
  const auto enter_x = slab(0, r.x, ray.near_offset.x);
  const auto enter_y = slab(1, r.y, ray.near_offset.y);
  const auto enter_z = slab(2, r.z, ray.near_offset.z);
  const auto exit_x = slab(0, WideRay::opposite(0, r.x), ray.far_offset.x);
  const auto exit_y = slab(1, WideRay::opposite(1, r.y), ray.far_offset.y);
  const auto exit_z = slab(2, WideRay::opposite(2, r.z), ray.far_offset.z);
  enter = hn::Max(hn::Max(enter_x, enter_y), hn::Max(enter_z, hn::Zero(di)));
  exit = hn::Min(hn::Min(exit_x, exit_y), hn::Min(exit_z, hn::BitCast(di, hn::Set(d, s_far))));
}

/// A bit per lane where `a` is not above `b`.
template <class V>
HWY_INLINE std::uint32_t not_above(V a, V b) {
  const hn::DFromV<V> d;
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3
  // One comparison; Highway has none for this, and negates the mask, in the middle of the chain that a ray
  // waits for.
  if constexpr (hn::MaxLanes(d) == 8) return _mm256_cmple_epi32_mask(a.raw, b.raw);
#endif
  std::uint8_t bits[8] = {0};
  hn::StoreMaskBits(d, hn::Not(hn::Gt(a, b)), bits);
  return bits[0];
}

/// Slab test of all eight slots: sets the bits of s_enter of each, returns a bit per slot that may be hit.
template <class Node>
HWY_INLINE std::uint32_t enter_children(const Node& node, const WideRay& r, float s_far,
                                        std::int32_t* HWY_RESTRICT s_enter) {
  const WideRay::D8 d;
  const hn::RebindToSigned<WideRay::D8> di;
  std::uint32_t hits = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    hn::Vec<decltype(di)> enter, exit;
    slab_test(node, r, s_far, i, enter, exit);
    hn::Store(enter, di, s_enter + i);
    hits |= not_above(enter, exit) << i;
  }
  return hits & used_slots(node);
}

template <Precision kPrecision, Collector C>
HWY_INLINE Offer intersect_leaf(const WideView& tree, std::uint32_t link, const WideRay& r, float s_far,
                                C& collector) {
  return intersect_leaf<kPrecision>(tree.blocks, wide_child::index(link), wide_child::block_count(link),
                                    r.block, s_far, collector);
}

template <Precision kPrecision, Collector C>
HWY_INLINE Offer intersect_leaf(const CompactView& tree, std::uint32_t link, const WideRay& r, float s_far,
                                C& collector) {
  TriangleBlock blocks[2];
  const std::uint32_t count = gather_leaf(tree, link, blocks);
  const Offer offer = intersect_leaf<kPrecision>(blocks, 0, count, r.block, s_far, collector);
  if constexpr (std::same_as<C, ClosestHit>) collector.best.corners_at = kInvalidId;  // the blocks are gone
  return offer;
}

/// What is still to visit, nearest on top. Entries of one node are inserted in order, unless the first hit
/// ends it all.
template <bool kSorted>
struct VisitStack {
  StackEntry entries[kWideStackSize];
  std::size_t size = 0;

  /// The nearest of the children of `hits`, of which there is one at least; the others go on the stack,
  /// farthest first.
  template <class View, class Node>
  HWY_INLINE std::uint32_t push_all_but_nearest(const View& tree, const Node& node, std::uint32_t hits,
                                                const std::int32_t* s_enter) {
    auto slot = std::uint32_t(__builtin_ctz(hits));
    hits &= hits - 1;
    if (hits == 0) return tree.child(node, slot);
    StackEntry next = entry(s_enter[slot], tree.child(node, slot));
    prefetch(tree, std::uint32_t(next));
    const std::size_t bottom = size;
    for (; hits != 0; hits &= hits - 1) {
      slot = std::uint32_t(__builtin_ctz(hits));
      StackEntry other = entry(s_enter[slot], tree.child(node, slot));
      prefetch(tree, std::uint32_t(other));
      if constexpr (kSorted) {
        const StackEntry nearer = std::min(next, other);
        other = std::max(next, other);
        next = nearer;
        std::size_t place = size++;
        for (; place > bottom && entries[place - 1] < other; --place) entries[place] = entries[place - 1];
        entries[place] = other;
      } else {
        entries[size++] = other;
      }
    }
    return std::uint32_t(next);
  }

  /// The next link that is entered before `last`; false when there is none.
  HWY_INLINE bool pop(StackEntry last, std::uint32_t& link) {
    do {
      if (size == 0) return false;
      --size;
    } while (kSorted && entries[size] > last);
    link = std::uint32_t(entries[size]);
    return true;
  }
};

struct StepsNotCounted {
  HWY_INLINE void operator()() const {}
};

/// True when an offer narrowed the range or ended the traversal. Calls step() at every node and leaf.
template <Precision kPrecision, class View, Collector C, class Step = StepsNotCounted>
HWY_INLINE bool traverse(const View& tree, const mesh::ObjectRay& ray, C& collector, const Step& step = {}) {
  const WideRay r(ray);
  VisitStack<!C::kStopsAtFirst> stack;
  bool narrowed = false;
  float s_far = ray.cull_far(collector.tfar());
  StackEntry last = far_entry(s_far);
  std::uint32_t link = 0;
  alignas(32) std::int32_t s_enter[8];
  for (;;) {
    step();
    if (!wide_child::is_leaf(link)) {
      const auto& node = tree.nodes[link];
      const std::uint32_t hits = enter_children(node, r, s_far, s_enter);
      if (hits != 0) {
        link = stack.push_all_but_nearest(tree, node, hits, s_enter);
        continue;
      }
    } else {
      const Offer offer = intersect_leaf<kPrecision>(tree, link, r, s_far, collector);
      if (offer == Offer::kDone) return true;
      if (offer == Offer::kNarrowed) {
        narrowed = true;
        s_far = ray.cull_far(collector.tfar());
        last = far_entry(s_far);
      }
    }
    if (!stack.pop(last, link)) return narrowed;
  }
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
