// Error-free products in vectors, with the bits of core/math/exact.h. Included once per instruction set (see
// hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_MATH_EXACT_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_MATH_EXACT_LANES_INL_H
#undef GRIDCAST_MATH_EXACT_LANES_INL_H
#else
#define GRIDCAST_MATH_EXACT_LANES_INL_H
#endif

#include <cstddef>

#include <hwy/highway.h>

#include "core/math/exact.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// gridcast::difference_of_products of each lane, a * b - c * d, of doubles.
template <class D>
HWY_INLINE hn::Vec<D> difference_of_products(D tag, hn::Vec<D> a, hn::Vec<D> b, hn::Vec<D> c, hn::Vec<D> d) {
#if HWY_TARGET == HWY_SSSE3 || HWY_TARGET == HWY_SSE4 || HWY_TARGET == HWY_SCALAR || HWY_TARGET == HWY_EMU128
  // These have no instruction that multiplies and adds with one rounding.
  HWY_ALIGN double x[4][hn::MaxLanes(D())];
  hn::Store(a, tag, x[0]);
  hn::Store(b, tag, x[1]);
  hn::Store(c, tag, x[2]);
  hn::Store(d, tag, x[3]);
  for (std::size_t i = 0; i < hn::Lanes(tag); ++i)
    x[0][i] = gridcast::difference_of_products(x[0][i], x[1][i], x[2][i], x[3][i]);
  return hn::Load(tag, x[0]);
#else
  (void)tag;
  const hn::Vec<D> cd = hn::Mul(c, d);
  return hn::Add(hn::MulSub(a, b, cd), hn::NegMulAdd(c, d, cd));
#endif
}

}  // namespace gridcast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
