// The SIMD filter in front of the triangle test, for blocks of four triangles. Included once per instruction
// set by the traversal kernels (see hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_BLAS_BLOCK_FILTER_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_BLOCK_FILTER_INL_H
#undef GRIDCAST_BLAS_BLOCK_FILTER_INL_H
#else
#define GRIDCAST_BLAS_BLOCK_FILTER_INL_H
#endif

#include <hwy/highway.h>

#include "core/blas/collector.h"
#include "core/blas/triangle_block.h"

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
        sign_z(r.direction_z >= 0.0 ? 1.F : -1.F) {}

  const mesh::ObjectRay& ray;
  float shear_x, shear_y, sign_z;
};

/// What the filter found out about the four triangles, a bit each.
struct BlockHits {
  std::uint32_t possible;  ///< may be hit in [0, s_far]; the others are not
  std::uint32_t certain;   ///< are hit, in the range; only when asked for
};

enum class Certain : std::uint8_t { kNotAsked, kAsked };
/// Whether the filter ends when it has seen that no triangle is met: it then does less, but that is hard to
/// foresee.
enum class EarlyOut : std::uint8_t { kNo, kYes };

using Block4 = hn::Vec<BlockRay::D4>;

/// The sheared triangles in float: edge functions with a bound of their rounding, and depths along z.
struct BlockEdges {
  Block4 u, v, w, bound;
  Block4 az, bz, cz;

  [[nodiscard]] HWY_INLINE Block4 lowest() const { return hn::Min(u, hn::Min(v, w)); }
  [[nodiscard]] HWY_INLINE Block4 highest() const { return hn::Max(u, hn::Max(v, w)); }
};

inline constexpr float kUnderflow = 0x1p-120F;

/// With q = 2^-24 and S as in ObjectRay::pad = 32 q S, a sheared coordinate is off by at most 8 q S = pad / 4
/// =: e (origin, difference, shear, product, difference), an edge function with largest coordinate m then by
/// less than 8 e (m + e) =: f, as in triangle_test.h. `fast` accepts points up to 12 q S = 1.5 e beside the
/// triangle, which moves an edge function by at most 1.5 e * 2.9 m more; twice the bound covers both.
/// In `exact` e has 4 times the ray's drift more (ObjectRay::prepare), of which a sheared corner takes 2.04
/// and the depth of a limit 1.13 (exact_test.h). Products of tiny numbers lose up to 2^-126 each, denormals
/// flushed or not: kUnderflow on top.
template <Precision kPrecision>
HWY_INLINE BlockEdges edges_of(const TriangleBlock& block, const BlockRay& r) {
  const BlockRay::D4 d;
  const mesh::ObjectRay& ray = r.ray;
  const auto ox = hn::Set(d, ray.cull_axes_origin.x);
  const auto oy = hn::Set(d, ray.cull_axes_origin.y);
  const auto oz = hn::Set(d, ray.cull_axes_origin.z);
  const auto shear_x = hn::Set(d, r.shear_x);
  const auto shear_y = hn::Set(d, r.shear_y);
  BlockEdges out;
  out.az = hn::Sub(hn::Load(d, block.corners[0][ray.kz]), oz);
  out.bz = hn::Sub(hn::Load(d, block.corners[1][ray.kz]), oz);
  out.cz = hn::Sub(hn::Load(d, block.corners[2][ray.kz]), oz);
  const auto ax = hn::NegMulAdd(shear_x, out.az, hn::Sub(hn::Load(d, block.corners[0][ray.kx]), ox));
  const auto bx = hn::NegMulAdd(shear_x, out.bz, hn::Sub(hn::Load(d, block.corners[1][ray.kx]), ox));
  const auto cx = hn::NegMulAdd(shear_x, out.cz, hn::Sub(hn::Load(d, block.corners[2][ray.kx]), ox));
  const auto ay = hn::NegMulAdd(shear_y, out.az, hn::Sub(hn::Load(d, block.corners[0][ray.ky]), oy));
  const auto by = hn::NegMulAdd(shear_y, out.bz, hn::Sub(hn::Load(d, block.corners[1][ray.ky]), oy));
  const auto cy = hn::NegMulAdd(shear_y, out.cz, hn::Sub(hn::Load(d, block.corners[2][ray.ky]), oy));
  out.u = hn::NegMulAdd(cy, bx, hn::Mul(cx, by));
  out.v = hn::NegMulAdd(ay, cx, hn::Mul(ax, cy));
  out.w = hn::NegMulAdd(by, ax, hn::Mul(bx, ay));
  const auto largest = hn::Max(hn::Max(hn::Max(hn::Abs(ax), hn::Abs(bx)), hn::Max(hn::Abs(cx), hn::Abs(ay))),
                               hn::Max(hn::Abs(by), hn::Abs(cy)));
  const float e = 0.25F * ray.pad;
  out.bound = hn::MulAdd(hn::Set(d, (kPrecision == Precision::kFast ? 16.F : 8.F) * e),
                         hn::Add(largest, hn::Set(d, e)), hn::Set(d, kUnderflow));
  return out;
}

/// N of a limit times the sign of D, and the bound of its rounding; see depths_of.
struct BlockDepths {
  Block4 area;  ///< |D|
  Block4 from_near, near_error;
  Block4 from_far, far_error;
};

/// Where the hits lie in the range, for `robust` and `exact`. A hit has depth (u az + v bz + w cz) / D with D
/// = u + v + w, so it lies beyond a limit l when N = u (az - l) + v (bz - l) + w (cz - l) has the sign of D.
/// Where the true edge functions are of one sign, |u| + |v| + |w| <= |D| + 6 f, and with F the largest |z -
/// l|, N is off by at most
///   (|D| + 6 f) (2 e + 4 q F) + 3 f (F + 2 e) < pad |D| + 4 f (F + pad)    as F < 4 S,
/// and N in the form Z - l D by as much. An infinite limit, an overflow or a NaN rejects nothing.
HWY_INLINE BlockDepths depths_of(const BlockEdges& edges, const BlockRay& r, float s_far) {
  const BlockRay::D4 d;
  // The direction's z component is +-1 in the culling half.
  const auto sign = hn::Set(d, r.sign_z);
  const auto sa = hn::Mul(edges.az, sign);
  const auto sb = hn::Mul(edges.bz, sign);
  const auto sc = hn::Mul(edges.cz, sign);
  const auto pad = hn::Set(d, r.ray.pad);
  const auto far = hn::Set(d, s_far);
  const auto sum = hn::Add(edges.u, hn::Add(edges.v, edges.w));
  const auto depth = hn::MulAdd(edges.u, sa, hn::MulAdd(edges.v, sb, hn::Mul(edges.w, sc)));
  const auto deepest = hn::Max(hn::Abs(sa), hn::Max(hn::Abs(sb), hn::Abs(sc)));
  const auto four_bounds = hn::Mul(hn::Set(d, 4.F), edges.bound);
  BlockDepths out;
  out.area = hn::Abs(sum);
  out.from_near = hn::Xor(depth, hn::Xor(sum, out.area));
  out.from_far = hn::NegMulAdd(far, out.area, out.from_near);
  out.near_error =
      hn::MulAdd(four_bounds, hn::Add(deepest, pad), hn::MulAdd(pad, out.area, hn::Set(d, kUnderflow)));
  out.far_error = hn::MulAdd(four_bounds, far, out.near_error);
  return out;
}

template <class Mask>
HWY_INLINE std::uint32_t bits_of(Mask mask) {
  std::uint8_t bits[8] = {0};
  hn::StoreMaskBits(BlockRay::D4(), mask, bits);
  return std::uint32_t(bits[0]) & 0xFU;
}

/// Looks at the edge functions, then at the depths of what is left.
template <Precision kPrecision, Certain kCertain, EarlyOut kEarlyOut = EarlyOut::kYes>
HWY_INLINE BlockHits filter_block(const TriangleBlock& block, const BlockRay& r, float s_far) {
  const BlockRay::D4 d;
  const BlockEdges edges = edges_of<kPrecision>(block, r);
  const auto lowest = edges.lowest();
  const auto highest = edges.highest();
  // Overflow gives NaN or infinity, and then no comparison rejects.
  const auto outside = hn::And(hn::Lt(lowest, hn::Neg(edges.bound)), hn::Gt(highest, edges.bound));
  if constexpr (kEarlyOut == EarlyOut::kYes)
    if (hn::Lanes(d) == 4 && hn::AllTrue(d, outside)) return {0, 0};

  if constexpr (kPrecision == Precision::kFast) {
    const auto sign = hn::Set(d, r.sign_z);
    const auto sa = hn::Mul(edges.az, sign);
    const auto sb = hn::Mul(edges.bz, sign);
    const auto sc = hn::Mul(edges.cz, sign);
    const auto beyond = hn::Gt(hn::Min(sa, hn::Min(sb, sc)), hn::Set(d, s_far + r.ray.pad));
    const auto before = hn::Lt(hn::Max(sa, hn::Max(sb, sc)), hn::Set(d, -r.ray.pad));
    return {~bits_of(hn::Or(outside, hn::Or(beyond, before))) & 0xFU, 0};
  } else {
    const BlockDepths depths = depths_of(edges, r, s_far);
    const auto out_of_range = hn::Or(hn::Lt(depths.from_near, hn::Neg(depths.near_error)),
                                     hn::Gt(depths.from_far, depths.far_error));
    const std::uint32_t possible = ~bits_of(hn::Or(outside, out_of_range)) & 0xFU;
    if constexpr (kCertain == Certain::kNotAsked) return {possible, 0};
    // All edge functions beyond their bound on one side, and the depth well inside the range: s_far is a pad
    // and its rounding, below another, beyond the s of tfar, and all t of s >= pad are beyond tnear.
    const auto inside = hn::Or(hn::Gt(lowest, edges.bound), hn::Lt(highest, hn::Neg(edges.bound)));
    const auto pad = hn::Set(d, r.ray.pad);
    const auto after_near = hn::Gt(depths.from_near, hn::MulAdd(pad, depths.area, depths.near_error));
    const auto before_far =
        hn::Lt(hn::MulAdd(hn::Add(pad, pad), depths.area, depths.from_far), hn::Neg(depths.far_error));
    return {possible, bits_of(hn::And(inside, hn::And(after_near, before_far)))};
  }
}

/// Decides about one triangle of a block.
template <Precision kPrecision, class Candidate>
HWY_INLINE bool decide_lane(const TriangleBlock& block, std::uint32_t lane, const mesh::ObjectRay& ray,
                            Candidate& hit) {
  if constexpr (kPrecision == Precision::kFast) {
    return mesh::intersect_triangle_fast(ray, block.corner(0, lane), block.corner(1, lane),
                                         block.corner(2, lane), hit);
  } else {
    const auto corner = [&](int number) {
      const auto& columns = block.corners[number];
      return Vec3f(columns[ray.kx][lane], columns[ray.ky][lane], columns[ray.kz][lane]);
    };
    const mesh::AxesTriangle triangle(corner(0), corner(1), corner(2));
    if constexpr (kPrecision == Precision::kExact)
      return mesh::intersect_triangle_exact(ray, triangle, block.ids[lane], hit);
    else
      return mesh::intersect_triangle_robust(ray, triangle, hit);
  }
}

/// What the filter has to find out for a collector.
template <Collector C>
inline constexpr Certain kCertainFor = C::kStopsAtFirst ? Certain::kAsked : Certain::kNotAsked;

/// Decides about what the filter left of a block; what was said to the hits together. `first` is the tree's
/// first block.
template <Precision kPrecision, Collector C>
HWY_INLINE Offer decide_block(const TriangleBlock* first, const TriangleBlock& block, const BlockHits& hits,
                              const mesh::ObjectRay& ray, C& collector) {
  for (std::uint32_t certain = hits.certain; certain != 0; certain &= certain - 1)
    if (block.ids[__builtin_ctz(certain)] != ray.excluded_primitive) return Offer::kDone;
  Offer all = Offer::kGoOn;
  for (std::uint32_t candidates = hits.possible; candidates != 0; candidates &= candidates - 1) {
    const auto lane = std::uint32_t(__builtin_ctz(candidates));
    typename C::Candidate hit;
    if (!decide_lane<kPrecision>(block, lane, ray, hit)) continue;
    const Offer offer = collector.offer(ray, hit, block.ids[lane]);
    if (offer == Offer::kDone) return offer;
    if (offer != Offer::kNarrowed) continue;
    all = offer;
    if constexpr (std::same_as<C, ClosestHit>)
      collector.best.corners_at = corners_at(std::size_t(&block - first), lane);
  }
  return all;
}

/// Tests `count` consecutive blocks from `first` on; what was said to the hits together.
template <Precision kPrecision, Collector C>
HWY_INLINE Offer intersect_leaf(const TriangleBlock* blocks, std::uint32_t first, std::uint32_t count,
                                const BlockRay& r, float s_far, C& collector) {
  Offer all = Offer::kGoOn;
  for (const TriangleBlock* block = blocks + first; count != 0; --count, ++block) {
    const BlockHits hits = filter_block<kPrecision, kCertainFor<C>>(*block, r, s_far);
    const Offer offer = decide_block<kPrecision>(blocks, *block, hits, r.ray, collector);
    if (offer == Offer::kDone) return offer;
    if (offer == Offer::kNarrowed) all = offer;
  }
  return all;
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
