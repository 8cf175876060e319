// Rows of doubles of several objects into the lanes of vectors, and back. Included once per instruction set
// (see hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_MATH_LANE_ROWS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_MATH_LANE_ROWS_INL_H
#undef GRIDCAST_MATH_LANE_ROWS_INL_H
#else
#define GRIDCAST_MATH_LANE_ROWS_INL_H
#endif

#include <array>
#include <cstddef>
#include <cstring>

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace gridcast::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Four numbers of each lane's object: v[k] holds number k.
template <class D>
struct Four {
  hn::Vec<D> v[4];
};

/// Numbers 0 to 3 of rows[lane], each at any address of a double.
template <class D>
HWY_INLINE Four<D> load_rows(D d, const std::array<const double*, hn::MaxLanes(D())>& rows);
/// The numbers to rows[lane], in the order of the lanes, as bits: what lies there may be of another type.
template <class D>
HWY_INLINE void store_rows(D d, const Four<D>& four, const std::array<double*, hn::MaxLanes(D())>& rows);

#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2

/// In each half of 256 bits: number c of vector r becomes number r of vector c.
template <class D>
HWY_INLINE Four<D> transposed(D d, const Four<D>& rows) {
  const auto a = hn::InterleaveLower(d, rows.v[0], rows.v[1]),
             b = hn::InterleaveUpper(d, rows.v[0], rows.v[1]);
  const auto c = hn::InterleaveLower(d, rows.v[2], rows.v[3]),
             e = hn::InterleaveUpper(d, rows.v[2], rows.v[3]);
  return {{hn::OddEvenBlocks(hn::SwapAdjacentBlocks(c), a), hn::OddEvenBlocks(hn::SwapAdjacentBlocks(e), b),
           hn::OddEvenBlocks(c, hn::SwapAdjacentBlocks(a)), hn::OddEvenBlocks(e, hn::SwapAdjacentBlocks(b))}};
}

template <class D>
HWY_INLINE Four<D> load_rows(D d, const std::array<const double*, hn::MaxLanes(D())>& rows) {
  Four<D> four;
  for (std::size_t k = 0; k < 4; ++k) {
    if constexpr (hn::MaxLanes(D()) == 8) {
      const hn::Half<D> half;
      four.v[k] = hn::Combine(d, hn::LoadU(half, rows[k + 4]), hn::LoadU(half, rows[k]));
    } else {
      four.v[k] = hn::LoadU(d, rows[k]);
    }
  }
  return transposed(d, four);
}

template <class D>
HWY_INLINE void store_rows(D d, const Four<D>& four, const std::array<double*, hn::MaxLanes(D())>& rows) {
  const Four<D> by_row = transposed(d, four);
  if constexpr (hn::MaxLanes(D()) == 8) {
    const hn::Half<D> half;
    for (std::size_t k = 0; k < 4; ++k) hn::StoreU(hn::LowerHalf(half, by_row.v[k]), half, rows[k]);
    for (std::size_t k = 0; k < 4; ++k) hn::StoreU(hn::UpperHalf(half, by_row.v[k]), half, rows[k + 4]);
  } else {
    for (std::size_t k = 0; k < 4; ++k) hn::StoreU(by_row.v[k], d, rows[k]);
  }
}

#else

template <class D>
HWY_INLINE Four<D> load_rows(D d, const std::array<const double*, hn::MaxLanes(D())>& rows) {
  alignas(64) double lanes[4][hn::MaxLanes(D())];
  for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane)
    for (std::size_t k = 0; k < 4; ++k) lanes[k][lane] = rows[lane][k];
  return {{hn::Load(d, lanes[0]), hn::Load(d, lanes[1]), hn::Load(d, lanes[2]), hn::Load(d, lanes[3])}};
}

template <class D>
HWY_INLINE void store_rows(D d, const Four<D>& four, const std::array<double*, hn::MaxLanes(D())>& rows) {
  alignas(64) double lanes[4][hn::MaxLanes(D())];
  for (std::size_t k = 0; k < 4; ++k) hn::Store(four.v[k], d, lanes[k]);
  for (std::size_t lane = 0; lane < hn::Lanes(d); ++lane) {
    double numbers[4];
    for (std::size_t k = 0; k < 4; ++k) numbers[k] = lanes[k][lane];
    std::memcpy(rows[lane], numbers, sizeof numbers);
  }
}

#endif

}  // namespace gridcast::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
