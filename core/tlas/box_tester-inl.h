// Slab tests of one ray with the boxes of a cell, compiled once per instruction set: included by the walks.

#if defined(GRIDCAST_TLAS_BOX_TESTER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_TLAS_BOX_TESTER_INL_H_
#undef GRIDCAST_TLAS_BOX_TESTER_INL_H_
#else
#define GRIDCAST_TLAS_BOX_TESTER_INL_H_
#endif

#include <hwy/highway.h>

#include "core/tlas/cell_tree.h"
#include "core/tlas/grid_block.h"
#include "core/tlas/grid_ray.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::tlas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Most groups on the stack: a node on the way down leaves at most seven behind.
inline constexpr std::size_t kStackSize = 7 * kMaxTreeDepth + 8;

/// A group to visit; ordered by the bits of its s_enter, which compare like the floats.
inline std::int64_t stack_entry(float s_enter, std::uint32_t link) {
  std::int32_t bits;
  __builtin_memcpy(&bits, &s_enter, 4);
  bits ^= (bits >> 31) & 0x7FFFFFFF;  // negative floats order backwards
  return (std::int64_t(bits) << 32) | std::int64_t(link);
}

template <std::size_t kSlots>
inline const BoxGroup<kSlots>& group_at(const std::byte* bytes) {
  const void* at = bytes;
  return *static_cast<const BoxGroup<kSlots>*>(at);
}

/// Which plane of a box each axis of a ray meets first.
class BoxTester {
 public:
  HWY_INLINE explicit BoxTester(const GridRay& ray) : ray_(ray) {
    for (int axis = 0; axis < 3; ++axis) {
      const int negative = ray.inverse[axis] >= 0.F ? 0 : 1;
      near_[axis] = negative * 3 + axis;
      far_plane_[axis] = (1 - negative) * 3 + axis;
    }
  }

  /// Slab test of all slots up to s_far: sets s_enter of each, returns a bit per slot that may be hit.
  template <std::size_t kSlots>
  HWY_INLINE std::uint32_t enter(const BoxGroup<kSlots>& group, float s_far,
                                 float* HWY_RESTRICT s_enter) const {
    const hn::CappedTag<float, kSlots> d;
    const float* planes = &group.planes[0][0][0];
    std::uint32_t hits = 0;
    for (std::size_t i = 0; i < kSlots; i += hn::Lanes(d)) {
      auto enter = hn::Set(d, ray_.s_near);
      auto exit = hn::Set(d, s_far);
      for (int axis = 0; axis < 3; ++axis) {
        const auto inverse = hn::Set(d, ray_.inverse[axis]);
        enter = hn::Max(enter, hn::MulAdd(hn::Load(d, planes + std::size_t(near_[axis]) * kSlots + i),
                                          inverse, hn::Set(d, ray_.near_offset[axis])));
        exit = hn::Min(exit, hn::MulAdd(hn::Load(d, planes + std::size_t(far_plane_[axis]) * kSlots + i),
                                        inverse, hn::Set(d, ray_.far_offset[axis])));
      }
      hn::Store(enter, d, s_enter + i);
      std::uint8_t bits[8] = {0};
      hn::StoreMaskBits(d, hn::Le(enter, exit), bits);
      hits |= std::uint32_t(bits[0]) << i;
    }
    return hits;
  }

 private:
  const GridRay& ray_;
  int near_[3], far_plane_[3];
};

}  // namespace gridcast::tlas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // toggle
