// The traversal kernel, compiled once per instruction set and chosen at run time by Highway.
// All of it only culls; mesh::intersect_primitive decides, in scalar double, so hits are the same on each.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/blas/wide_traversal.cpp"  // NOLINT: Highway includes this file once per target

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/blas/block_filter-inl.h"
#include "core/blas/wide_bvh.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// A node or leaf to visit; ordered by the bits of its s_enter, which compare like the floats.
using StackEntry = std::int64_t;

inline std::int64_t entry(float s_enter, std::uint32_t link) {
  std::int32_t bits;
  __builtin_memcpy(&bits, &s_enter, 4);
  bits ^= (bits >> 31) & 0x7FFFFFFF;  // negative floats order backwards
  return (std::int64_t(bits) << 32) | std::int64_t(link);
}

/// The ray spread over lanes, and which planes are near.
struct WideRay {
  using D8 = hn::CappedTag<float, 8>;

  explicit HWY_INLINE WideRay(const mesh::ObjectRay& r) : ray(r), block(r) {
    for (int axis = 0; axis < 3; ++axis) {
      const int negative = r.inverse_direction[axis] >= 0.F ? 0 : 1;
      near_plane[axis] = (negative * 3 + axis) * 8;
      far_plane[axis] = ((1 - negative) * 3 + axis) * 8;
    }
  }

  const mesh::ObjectRay& ray;
  BlockRay block;
  int near_plane[3];
  int far_plane[3];
};

/// Slab test of all eight slots: sets s_enter of each, returns a bit per slot that may be hit.
HWY_INLINE std::uint32_t enter_children(const WideNode& node, const WideRay& r, float s_far,
                                        float* HWY_RESTRICT s_enter) {
  const WideRay::D8 d;
  const float* planes = &node.planes[0][0][0];
  const mesh::ObjectRay& ray = r.ray;
  std::uint32_t hits = 0;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
    auto enter = hn::Zero(d);
    auto exit = hn::Set(d, s_far);
    for (int axis = 0; axis < 3; ++axis) {
      const auto inverse = hn::Set(d, ray.inverse_direction[axis]);
      enter = hn::Max(enter, hn::MulAdd(hn::Load(d, planes + r.near_plane[axis] + i), inverse,
                                        hn::Set(d, ray.near_offset[axis])));
      exit = hn::Min(exit, hn::MulAdd(hn::Load(d, planes + r.far_plane[axis] + i), inverse,
                                      hn::Set(d, ray.far_offset[axis])));
    }
    hn::Store(enter, d, s_enter + i);
    std::uint8_t bits[8] = {0};
    hn::StoreMaskBits(d, hn::Le(enter, exit), bits);
    hits |= std::uint32_t(bits[0]) << i;
  }
  return hits;
}

// The stack holds what is still to visit, nearest on top. Entries of one node are inserted in order.
template <Precision kPrecision, bool kAnyHit>
HWY_INLINE bool traverse(const WideNode* nodes, const TriangleBlock* blocks, const mesh::ObjectRay& ray,
                         Hit& best) {
  const WideRay r(ray);
  StackEntry stack[kWideStackSize];
  std::size_t size = 0;
  bool replaced = false;
  float s_far = ray.cull_far(best.t);
  std::int64_t far_entry = entry(s_far, 0xFFFFFFFFU);
  std::uint32_t link = 0;
  alignas(32) float s_enter[8];
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
        const std::size_t bottom = size;
        for (; hits != 0; hits &= hits - 1) {
          slot = std::uint32_t(__builtin_ctz(hits));
          std::int64_t other = entry(s_enter[slot], node.child[slot]);
          if constexpr (!kAnyHit) {
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
    } else if (intersect_leaf<kPrecision, kAnyHit>(blocks + wide_child::index(link),
                                                   wide_child::block_count(link), r.block, s_far, best)) {
      if constexpr (kAnyHit) return true;
      replaced = true;
      s_far = ray.cull_far(best.t);
      far_entry = entry(s_far, 0xFFFFFFFFU);
    }
    do {
      if (size == 0) return replaced;
      --size;
    } while (!kAnyHit && stack[size] > far_entry);
    link = std::uint32_t(stack[size]);
  }
}

bool closest_fast(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, Hit& h) {
  return traverse<Precision::kFast, false>(n, b, r, h);
}
bool any_fast(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, Hit& h) {
  return traverse<Precision::kFast, true>(n, b, r, h);
}
bool closest_robust(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, Hit& h) {
  return traverse<Precision::kRobust, false>(n, b, r, h);
}
bool any_robust(const WideNode* n, const TriangleBlock* b, const mesh::ObjectRay& r, Hit& h) {
  return traverse<Precision::kRobust, true>(n, b, r, h);
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::blas {

HWY_EXPORT(closest_fast);
HWY_EXPORT(any_fast);
HWY_EXPORT(closest_robust);
HWY_EXPORT(any_robust);

template <Precision kPrecision, bool kAnyHit>
bool WideBvh::intersect(const mesh::TriangleMesh& /*mesh*/, const mesh::ObjectRay& ray, Hit& best) const {
  if (nodes_.empty()) return false;
  const WideNode* n = nodes_.data();
  const TriangleBlock* b = blocks_.data();
  if constexpr (kPrecision == Precision::kFast) {
    if constexpr (kAnyHit) return HWY_DYNAMIC_DISPATCH(any_fast)(n, b, ray, best);
    return HWY_DYNAMIC_DISPATCH(closest_fast)(n, b, ray, best);
  } else {
    if constexpr (kAnyHit) return HWY_DYNAMIC_DISPATCH(any_robust)(n, b, ray, best);
    return HWY_DYNAMIC_DISPATCH(closest_robust)(n, b, ray, best);
  }
}

template bool WideBvh::intersect<Precision::kFast, false>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                          Hit&) const;
template bool WideBvh::intersect<Precision::kFast, true>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                         Hit&) const;
template bool WideBvh::intersect<Precision::kRobust, false>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                            Hit&) const;
template bool WideBvh::intersect<Precision::kRobust, true>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                           Hit&) const;

}  // namespace gridcast::blas
#endif
