// The traversal kernel, compiled once per instruction set and chosen at run time by Highway.
// All of it only culls; mesh::intersect_triangle decides, in scalar double, so hits are the same on each.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/blas/wide_traversal.cpp"  // NOLINT: Highway includes this file once per target

#include <bit>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/blas/block_filter-inl.h"
#include "core/blas/kernel_steps.h"
#include "core/blas/wide_bvh.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

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
  /// Floats from the lower planes of an axis to the upper ones, and from an axis to the next.
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

/// Slab test of all eight slots: sets the bits of s_enter of each, returns a bit per slot that may be hit.
/// Integers compare like the floats here, in fewer cycles: a negative distance is below every other, whatever
/// its size, and loses against the 0 of the start or fails as an exit.
HWY_INLINE std::uint32_t enter_children(const WideNode& node, const WideRay& r, float s_far,
                                        std::int32_t* HWY_RESTRICT s_enter) {
  const WideRay::D8 d;
  const hn::RebindToSigned<WideRay::D8> di;
  const float* planes = &node.planes[0][0][0];
  const mesh::ObjectRay& ray = r.ray;
  std::uint32_t hits = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    const float* at = planes + i;
    const auto slab = [&](std::size_t plane, float inverse, float offset) HWY_ATTR {
      return hn::BitCast(di, hn::MulAdd(hn::Load(d, at + plane), hn::Set(d, inverse), hn::Set(d, offset)));
    };
    const auto enter_x = slab(r.x, ray.inverse_direction.x, ray.near_offset.x);
    const auto enter_y = slab(r.y, ray.inverse_direction.y, ray.near_offset.y);
    const auto enter_z = slab(r.z, ray.inverse_direction.z, ray.near_offset.z);
    const auto exit_x = slab(WideRay::opposite(0, r.x), ray.inverse_direction.x, ray.far_offset.x);
    const auto exit_y = slab(WideRay::opposite(1, r.y), ray.inverse_direction.y, ray.far_offset.y);
    const auto exit_z = slab(WideRay::opposite(2, r.z), ray.inverse_direction.z, ray.far_offset.z);
    const auto enter = hn::Max(hn::Max(enter_x, enter_y), hn::Max(enter_z, hn::Zero(di)));
    const auto exit = hn::Min(hn::Min(exit_x, exit_y), hn::Min(exit_z, hn::BitCast(di, hn::Set(d, s_far))));
    hn::Store(enter, di, s_enter + i);
    std::uint8_t bits[8] = {0};
    hn::StoreMaskBits(di, hn::Not(hn::Gt(enter, exit)), bits);
    hits |= std::uint32_t(bits[0]) << i;
  }
  return hits;
}

/// Asks for the memory of a node or of the first block of a leaf that will be looked at soon: with trees
/// larger than the second-level cache that is what a ray waits for most.
HWY_INLINE void prefetch(const WideNode* nodes, const TriangleBlock* blocks, std::uint32_t link) {
  constexpr std::size_t kLine = 64;
  const bool leaf = wide_child::is_leaf(link);
  const void* place = leaf ? static_cast<const void*>(blocks + wide_child::index(link)) : nodes + link;
  const auto* line = static_cast<const std::byte*>(place);
  const std::size_t size = leaf ? sizeof(TriangleBlock) : sizeof(WideNode);
  for (std::size_t at = 0; at < size; at += kLine) __builtin_prefetch(line + at);
}

// The stack holds what is still to visit, nearest on top. Entries of one node are inserted in order.
template <Precision kPrecision, Collector C>
HWY_INLINE bool traverse(const WideNode* nodes, const TriangleBlock* blocks, const mesh::ObjectRay& ray,
                         C& collector) {
  const WideRay r(ray);
  StackEntry stack[kWideStackSize];
  std::size_t size = 0;
  bool narrowed = false;
  float s_far = ray.cull_far(collector.tfar());
  StackEntry last = far_entry(s_far);
  std::uint32_t link = 0;
  alignas(32) std::int32_t s_enter[8];
  for (;;) {
    if (!wide_child::is_leaf(link)) {
      const WideNode& node = nodes[link];
      std::uint32_t hits = enter_children(node, r, s_far, s_enter);
      if (hits != 0) {
        // The nearest child stays in `next`; the others go on the stack, farthest first.
        std::int64_t next = 0;
        auto slot = std::uint32_t(__builtin_ctz(hits));
        hits &= hits - 1;
        if (hits == 0) {
          link = node.child[slot];
          continue;
        }
        next = entry(s_enter[slot], node.child[slot]);
        prefetch(nodes, blocks, node.child[slot]);
        const std::size_t bottom = size;
        for (; hits != 0; hits &= hits - 1) {
          slot = std::uint32_t(__builtin_ctz(hits));
          std::int64_t other = entry(s_enter[slot], node.child[slot]);
          prefetch(nodes, blocks, node.child[slot]);
          if constexpr (!C::kStopsAtFirst) {
            const std::int64_t nearer = std::min(next, other);
            other = std::max(next, other);
            next = nearer;
            std::size_t place = size++;
            for (; place > bottom && stack[place - 1] < other; --place) stack[place] = stack[place - 1];
            stack[place] = other;
          } else {
            stack[size++] = other;
          }
        }
        link = std::uint32_t(next);
        continue;
      }
    } else {
      const Offer offer = intersect_leaf<kPrecision>(
          blocks, wide_child::index(link), wide_child::block_count(link), r.block, s_far, collector);
      if (offer == Offer::kDone) return true;
      if (offer == Offer::kNarrowed) {
        narrowed = true;
        s_far = ray.cull_far(collector.tfar());
        last = far_entry(s_far);
      }
    }
    do {
      if (size == 0) return narrowed;
      --size;
    } while (!C::kStopsAtFirst && stack[size] > last);
    link = std::uint32_t(stack[size]);
  }
}

// One function for each kernel: Highway dispatches functions, not templates.
bool closest_fast(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, ClosestHit& c) {
  return traverse<Precision::kFast>(n, b, r, c);
}
bool closest_robust(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, ClosestHit& c) {
  return traverse<Precision::kRobust>(n, b, r, c);
}
bool any_fast(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, AnyHit& c) {
  return traverse<Precision::kFast>(n, b, r, c);
}
bool any_robust(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, AnyHit& c) {
  return traverse<Precision::kRobust>(n, b, r, c);
}
bool every_fast(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, HitSink& c) {
  return traverse<Precision::kFast>(n, b, r, c);
}
bool every_robust(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, HitSink& c) {
  return traverse<Precision::kRobust>(n, b, r, c);
}
bool closest_exact(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, ExactClosest& c) {
  return traverse<Precision::kExact>(n, b, r, c);
}
bool any_exact(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, ExactAny& c) {
  return traverse<Precision::kExact>(n, b, r, c);
}

std::uint32_t enter_node(const WideNode& node, const mesh::ObjectRay& ray, float s_far, SlotEntries& out) {
  return enter_children(node, WideRay(ray), s_far, out.s_enter_bits);
}
std::uint32_t filter_fast(const TriangleBlock& block, const mesh::ObjectRay& ray, float s_far) {
  return filter_block<Precision::kFast, Certain::kNotAsked>(block, BlockRay(ray), s_far).possible;
}
std::uint32_t filter_robust(const TriangleBlock& block, const mesh::ObjectRay& ray, float s_far) {
  return filter_block<Precision::kRobust, Certain::kNotAsked>(block, BlockRay(ray), s_far).possible;
}
std::uint32_t filter_exact(const TriangleBlock& block, const mesh::ObjectRay& ray, float s_far) {
  return filter_block<Precision::kExact, Certain::kNotAsked>(block, BlockRay(ray), s_far).possible;
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::blas {

HWY_EXPORT(closest_fast);
HWY_EXPORT(closest_robust);
HWY_EXPORT(any_fast);
HWY_EXPORT(any_robust);
HWY_EXPORT(every_fast);
HWY_EXPORT(every_robust);
HWY_EXPORT(closest_exact);
HWY_EXPORT(any_exact);
HWY_EXPORT(enter_node);
HWY_EXPORT(filter_fast);
HWY_EXPORT(filter_robust);
HWY_EXPORT(filter_exact);

std::uint32_t enter_wide_node(const WideNode& node, const mesh::ObjectRay& ray, float s_far,
                              SlotEntries& entries) {
  return HWY_DYNAMIC_DISPATCH(enter_node)(node, ray, s_far, entries);
}

template <Precision kPrecision>
std::uint32_t filter_triangles(const TriangleBlock& block, const mesh::ObjectRay& ray, float s_far) {
  if constexpr (kPrecision == Precision::kFast) return HWY_DYNAMIC_DISPATCH(filter_fast)(block, ray, s_far);
  if constexpr (kPrecision == Precision::kExact) return HWY_DYNAMIC_DISPATCH(filter_exact)(block, ray, s_far);
  return HWY_DYNAMIC_DISPATCH(filter_robust)(block, ray, s_far);
}

template std::uint32_t filter_triangles<Precision::kFast>(const TriangleBlock&, const mesh::ObjectRay&,
                                                          float);
template std::uint32_t filter_triangles<Precision::kRobust>(const TriangleBlock&, const mesh::ObjectRay&,
                                                            float);
template std::uint32_t filter_triangles<Precision::kExact>(const TriangleBlock&, const mesh::ObjectRay&,
                                                           float);

template <Precision kPrecision, Collector C>
bool WideBvh::intersect(const mesh::TriangleMesh& /*mesh*/, const mesh::ObjectRay& ray, C& collector) const {
  if (nodes().empty()) return false;
  const WideNode* n = nodes().data();
  const TriangleBlock* b = blocks().data();
  constexpr bool kFast = kPrecision == Precision::kFast;
  if constexpr (std::same_as<C, ExactClosest>) {
    return HWY_DYNAMIC_DISPATCH(closest_exact)(n, b, ray, collector);
  } else if constexpr (std::same_as<C, ExactAny>) {
    return HWY_DYNAMIC_DISPATCH(any_exact)(n, b, ray, collector);
  } else if constexpr (std::same_as<C, ClosestHit>) {
    if constexpr (kFast) return HWY_DYNAMIC_DISPATCH(closest_fast)(n, b, ray, collector);
    return HWY_DYNAMIC_DISPATCH(closest_robust)(n, b, ray, collector);
  } else if constexpr (std::same_as<C, AnyHit>) {
    if constexpr (kFast) return HWY_DYNAMIC_DISPATCH(any_fast)(n, b, ray, collector);
    return HWY_DYNAMIC_DISPATCH(any_robust)(n, b, ray, collector);
  } else {
    if constexpr (kFast) return HWY_DYNAMIC_DISPATCH(every_fast)(n, b, ray, collector);
    return HWY_DYNAMIC_DISPATCH(every_robust)(n, b, ray, collector);
  }
}

template bool WideBvh::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                   ClosestHit&) const;
template bool WideBvh::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                   AnyHit&) const;
template bool WideBvh::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                   HitSink&) const;
template bool WideBvh::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                     ClosestHit&) const;
template bool WideBvh::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                     AnyHit&) const;
template bool WideBvh::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                     HitSink&) const;
template bool WideBvh::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                    ExactClosest&) const;
template bool WideBvh::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                    ExactAny&) const;

}  // namespace gridcast::blas
#endif
