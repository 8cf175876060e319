// The children of a node that a ray may hit, in the order of its visits and without a branch. AVX-512 alone:
// Highway has neither its masked maximum nor shuffles that are as cheap. Included once per instruction set
// (see hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_BLAS_CHILD_ORDER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_CHILD_ORDER_INL_H
#undef GRIDCAST_BLAS_CHILD_ORDER_INL_H
#else
#define GRIDCAST_BLAS_CHILD_ORDER_INL_H
#endif

#include <cstdint>
#include <limits>

#include <hwy/highway.h>

#if HWY_TARGET <= HWY_AVX3 && HWY_ARCH_X86
#include <immintrin.h>

#include "core/blas/wide_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

/// All lanes: without a mask g++ 12 takes the intrinsics' undefined operands for mistakes.
constexpr __mmask8 kAll = 0xFF;

/// One layer of a sorting network: the larger of lane i and its partner goes to the lanes of `larger`.
HWY_INLINE __m512i sort_layer(__m512i v, __m512i partner, __mmask8 larger) {
  return _mm512_mask_max_epi64(_mm512_maskz_min_epi64(kAll, v, partner), larger, v, partner);
}

/// Eight numbers, the smallest first: K. Batcher's bitonic network, "Sorting Networks and Their
/// Applications", 1968, with mirrored first layers, so that all comparators point one way.
HWY_INLINE __m512i sorted_up(__m512i v) {
  const auto swap_neighbours = [](__m512i x)
                                   HWY_ATTR { return _mm512_maskz_shuffle_epi32(0xFFFF, x, _MM_PERM_BADC); };
  const auto swap_pairs = [](__m512i x) HWY_ATTR { return _mm512_maskz_permutex_epi64(kAll, x, 0x4E); };
  const auto mirror_fours = [](__m512i x) HWY_ATTR { return _mm512_maskz_permutex_epi64(kAll, x, 0x1B); };
  const auto mirror = [](__m512i x) HWY_ATTR {
    return _mm512_maskz_permutexvar_epi64(kAll, _mm512_set_epi64(0, 1, 2, 3, 4, 5, 6, 7), x);
  };
  v = sort_layer(v, swap_neighbours(v), 0xAA);
  v = sort_layer(v, mirror_fours(v), 0xCC);
  v = sort_layer(v, swap_neighbours(v), 0xAA);
  v = sort_layer(v, mirror(v), 0xF0);
  v = sort_layer(v, swap_pairs(v), 0xCC);
  return sort_layer(v, swap_neighbours(v), 0xAA);
}

/// The children of a node that may be hit, beneath `top`: the nearest first if kSorted.
struct PushedChildren {
  std::uint32_t count;
  StackEntry first;  ///< anything when there is none
};
template <bool kSorted, class Node>
HWY_INLINE PushedChildren push_children(const Node& node, const WideRay& r, float s_far, StackEntry* top) {
  const hn::RebindToSigned<WideRay::D8> di;
  hn::Vec<decltype(di)> enter, exit;
  slab_test(node, r, s_far, 0, enter, exit);
  const __mmask8 hits = _mm256_cmple_epi32_mask(enter.raw, exit.raw);
  const auto count = std::uint32_t(__builtin_popcount(hits));
  const __m256i links = _mm256_load_si256(static_cast<const __m256i*>(static_cast<const void*>(node.child)));
  const __m512i high = _mm512_maskz_slli_epi64(kAll, _mm512_maskz_cvtepu32_epi64(kAll, enter.raw), 32);
  const __m512i entries = _mm512_or_si512(high, _mm512_maskz_cvtepu32_epi64(kAll, links));
  __m512i ordered;
  if constexpr (kSorted) {
    const __m512i none = _mm512_set1_epi64(std::numeric_limits<StackEntry>::max());
    ordered = sorted_up(_mm512_mask_mov_epi64(none, hits, entries));
  } else {
    ordered = _mm512_maskz_compress_epi64(hits, entries);
  }
  _mm512_mask_storeu_epi64(top - count, __mmask8((1U << count) - 1U), ordered);
  return {count, ordered[0]};
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // AVX-512
#endif
