// The SIMD filter in front of the triangle test, for blocks of four triangles. Included once per instruction
// set by the traversal kernels (see hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_BLAS_BLOCK_FILTER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_BLOCK_FILTER_INL_H
#undef GRIDCAST_BLAS_BLOCK_FILTER_INL_H
#else
#define GRIDCAST_BLAS_BLOCK_FILTER_INL_H
#endif

#include <hwy/highway.h>

#include "core/blas/triangle_block.h"
#include "core/mesh/triangle_test.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// What the filter needs of a ray beside the prepared ray itself.
struct BlockRay {
  using D4 = hn::CappedTag<float, 4>;

  explicit HWY_INLINE BlockRay(const mesh::ObjectRay& r)
      : ray(r),
        shear_x(float(r.shear_x)),
        shear_y(float(r.shear_y)),
        sign_z(r.cull_direction[r.kz] >= 0.F ? 1.F : -1.F) {}

  const mesh::ObjectRay& ray;
  float shear_x, shear_y, sign_z;
};

/// Which of the four triangles the ray may hit before s_far: the edge functions of the sheared triangle in
/// float, against a bound of their rounding.
///
/// With q = 2^-24 and S as in ObjectRay::pad = 32 q S, a sheared coordinate is off by at most 8 q S = pad / 4
/// =: e (origin, difference, shear, product, difference), an edge function with largest coordinate m then by
/// less than 8 e (m + e), as in triangle_test.cpp. `fast` accepts points up to 12 q S = 1.5 e beside the
/// triangle, which moves an edge function by at most 1.5 e * 2.9 m more; twice the bound covers both.
template <Precision kPrecision>
HWY_INLINE std::uint32_t filter_block(const TriangleBlock& block, const BlockRay& r, float s_far) {
  const BlockRay::D4 d;
  const mesh::ObjectRay& ray = r.ray;
  const auto ox = hn::Set(d, ray.cull_origin[ray.kx]);
  const auto oy = hn::Set(d, ray.cull_origin[ray.ky]);
  const auto oz = hn::Set(d, ray.cull_origin[ray.kz]);
  const auto shear_x = hn::Set(d, r.shear_x);
  const auto shear_y = hn::Set(d, r.shear_y);

  const auto az = hn::Sub(hn::Load(d, block.corners[0][ray.kz]), oz);
  const auto bz = hn::Sub(hn::Load(d, block.corners[1][ray.kz]), oz);
  const auto cz = hn::Sub(hn::Load(d, block.corners[2][ray.kz]), oz);
  const auto ax = hn::NegMulAdd(shear_x, az, hn::Sub(hn::Load(d, block.corners[0][ray.kx]), ox));
  const auto bx = hn::NegMulAdd(shear_x, bz, hn::Sub(hn::Load(d, block.corners[1][ray.kx]), ox));
  const auto cx = hn::NegMulAdd(shear_x, cz, hn::Sub(hn::Load(d, block.corners[2][ray.kx]), ox));
  const auto ay = hn::NegMulAdd(shear_y, az, hn::Sub(hn::Load(d, block.corners[0][ray.ky]), oy));
  const auto by = hn::NegMulAdd(shear_y, bz, hn::Sub(hn::Load(d, block.corners[1][ray.ky]), oy));
  const auto cy = hn::NegMulAdd(shear_y, cz, hn::Sub(hn::Load(d, block.corners[2][ray.ky]), oy));

  const auto u = hn::NegMulAdd(cy, bx, hn::Mul(cx, by));
  const auto v = hn::NegMulAdd(ay, cx, hn::Mul(ax, cy));
  const auto w = hn::NegMulAdd(by, ax, hn::Mul(bx, ay));
  const auto largest = hn::Max(hn::Max(hn::Max(hn::Abs(ax), hn::Abs(bx)), hn::Max(hn::Abs(cx), hn::Abs(ay))),
                               hn::Max(hn::Abs(by), hn::Abs(cy)));
  const float e = 0.25F * ray.pad;
  const auto bound =
      hn::Mul(hn::Set(d, (kPrecision == Precision::kFast ? 16.F : 8.F) * e), hn::Add(largest, hn::Set(d, e)));
  const auto lowest = hn::Min(u, hn::Min(v, w));
  const auto highest = hn::Max(u, hn::Max(v, w));
  // Overflow gives NaN or infinity, and then no comparison rejects.
  const auto outside = hn::And(hn::Lt(lowest, hn::Neg(bound)), hn::Gt(highest, bound));

  // Depths along the ray: the direction's z component is +-1 in the culling half.
  const auto sign = hn::Set(d, r.sign_z);
  const auto sa = hn::Mul(az, sign);
  const auto sb = hn::Mul(bz, sign);
  const auto sc = hn::Mul(cz, sign);
  const auto beyond = hn::Gt(hn::Min(sa, hn::Min(sb, sc)), hn::Set(d, s_far + ray.pad));
  const auto before = hn::Lt(hn::Max(sa, hn::Max(sb, sc)), hn::Set(d, ray.cull_near - ray.pad));
  std::uint8_t bits[8] = {0};
  hn::StoreMaskBits(d, hn::Or(outside, hn::Or(beyond, before)), bits);
  return ~std::uint32_t(bits[0]) & 0xFU;
}

/// Tests `count` consecutive blocks; true when `best` was replaced.
template <Precision kPrecision, bool kAnyHit>
HWY_INLINE bool intersect_leaf(const TriangleBlock* block, std::uint32_t count, const BlockRay& r,
                               float s_far, Hit& best) {
  bool replaced = false;
  for (; count != 0; --count, ++block) {
    for (std::uint32_t candidates = filter_block<kPrecision>(*block, r, s_far); candidates != 0;
         candidates &= candidates - 1) {
      const auto lane = std::uint32_t(__builtin_ctz(candidates));
      replaced |= mesh::intersect_primitive<kPrecision>(r.ray, block->corner(0, lane), block->corner(1, lane),
                                                        block->corner(2, lane), block->ids[lane], best);
      if (kAnyHit && replaced) return true;
    }
  }
  return replaced;
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
