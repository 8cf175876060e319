// Which rays of a packet may hit which triangle, compiled once per instruction set: included by
// packet_walk-inl.h alone.

#if defined(GRIDCAST_BLAS_PACKET_TRIANGLES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_PACKET_TRIANGLES_INL_H_
#undef GRIDCAST_BLAS_PACKET_TRIANGLES_INL_H_
#else
#define GRIDCAST_BLAS_PACKET_TRIANGLES_INL_H_
#endif

#include <hwy/highway.h>

#include "core/blas/packet_frame-inl.h"
#include "core/blas/wide_bvh.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

/// The edge functions of four triangles as functions of the ray.
///
/// Seen along the middle ray, with z measured from the common plane, a vertex p is at (px, py, pz); along a
/// ray with the deltas (X, Y) of origin and (m, n) of slope at (px - X - m pz, py - Y - n pz). The edge
/// function of two such points p, q, their cross product, is then linear in the ray:
///   px qy - py qx + m (py qz - pz qy) + n (pz qx - px qz) + X (py - qy) + Y (qx - px) + (X n - Y m)(qz -
///   pz),
/// so that sixteen rays cost two multiplications an edge when they share an origin (X = Y = 0), and five when
/// not.
struct BundleTriangles {
  alignas(32) float edge[3][6][4];  ///< [edge][term][triangle]
  alignas(16) float bound[4];       ///< of the rounding of an edge function
  alignas(16) float s_low[4];       ///< depths of the triangle
  alignas(16) float s_high[4];
};

using D4 = hn::CappedTag<float, 4>;

struct Corner {
  hn::VFromD<D4> x, y, z;
};

/// The corners of the triangles from `first` on, as many as there are lanes, as seen along one ray or along
/// the middle one.
struct Corners {
  Corner a, b, c;

  HWY_INLINE Corners(const TriangleBlock& block, std::size_t first, const PacketFrame& frame,
                     const float (&origin)[2], const float (&slope)[2])
      : a(corner(block.corners[0], first, frame, origin, slope)),
        b(corner(block.corners[1], first, frame, origin, slope)),
        c(corner(block.corners[2], first, frame, origin, slope)) {}

  static HWY_INLINE Corner corner(const float (&columns)[3][4], std::size_t first, const PacketFrame& frame,
                                  const float (&origin)[2], const float (&slope)[2]) {
    const D4 d;
    const auto z = hn::Sub(hn::Load(d, columns[frame.axes[2]] + first), hn::Set(d, frame.plane_z));
    const auto x = hn::Sub(hn::Load(d, columns[frame.axes[0]] + first), hn::Set(d, origin[0]));
    const auto y = hn::Sub(hn::Load(d, columns[frame.axes[1]] + first), hn::Set(d, origin[1]));
    return {hn::NegMulAdd(hn::Set(d, slope[0]), z, x), hn::NegMulAdd(hn::Set(d, slope[1]), z, y), z};
  }

  /// The largest x or y.
  [[nodiscard]] HWY_INLINE hn::VFromD<D4> largest() const {
    return hn::Max(hn::Max(hn::Max(hn::Abs(a.x), hn::Abs(b.x)), hn::Max(hn::Abs(c.x), hn::Abs(a.y))),
                   hn::Max(hn::Abs(b.y), hn::Abs(c.y)));
  }
  [[nodiscard]] HWY_INLINE hn::VFromD<D4> s_low(const PacketFrame& frame) const {
    const D4 d;
    const auto sign = hn::Set(d, frame.sign_z);
    const auto low = hn::Min(hn::Mul(a.z, sign), hn::Min(hn::Mul(b.z, sign), hn::Mul(c.z, sign)));
    return hn::Sub(low, hn::Set(d, frame.pad));
  }
  [[nodiscard]] HWY_INLINE hn::VFromD<D4> s_high(const PacketFrame& frame) const {
    const D4 d;
    const auto sign = hn::Set(d, frame.sign_z);
    const auto high = hn::Max(hn::Mul(a.z, sign), hn::Max(hn::Mul(b.z, sign), hn::Mul(c.z, sign)));
    return hn::Add(high, hn::Set(d, frame.pad));
  }
};

HWY_INLINE void store_edge(const Corner& p, const Corner& q, bool common_origin, std::size_t first,
                           float (*HWY_RESTRICT out)[4]) {
  const D4 d;
  hn::Store(hn::NegMulAdd(p.y, q.x, hn::Mul(p.x, q.y)), d, out[0] + first);
  hn::Store(hn::NegMulAdd(p.z, q.y, hn::Mul(p.y, q.z)), d, out[1] + first);
  hn::Store(hn::NegMulAdd(p.x, q.z, hn::Mul(p.z, q.x)), d, out[2] + first);
  if (common_origin) return;
  hn::Store(hn::Sub(p.y, q.y), d, out[3] + first);
  hn::Store(hn::Sub(q.x, p.x), d, out[4] + first);
  hn::Store(hn::Sub(q.z, p.z), d, out[5] + first);
}

/// Four bits or sixteen, as an integer.
template <class D, class M>
HWY_INLINE std::uint32_t bits_of(D d, M mask) {
  std::uint8_t bits[8] = {0};
  hn::StoreMaskBits(d, mask, bits);
  return std::uint32_t(bits[0]) | std::uint32_t(bits[1]) << 8;
}

// The bound. As in wide_traversal.cpp a vertex as seen by a ray is off by less than e = pad / 4 = 8 q S: here
// the subtractions and the shear cost 4 q S and the float deltas of the ray 2 q S. With M the largest
// coordinate as seen by any ray of the bundle, the true edge function of the rounded vertices is off by less
// than 8 e (M + e); `fast` accepts points beside the triangle and doubles that. Evaluating the sum rounds at
// most nine times a term of a sum of sizes below 14 M^2: every product above has a factor that is M at most
// by itself and another that is once multiplied by its delta. That is below 126 q M^2 < 2^-17 M^2.
template <Precision kPrecision>
HWY_INLINE void prepare_triangles(const TriangleBlock& block, const PacketFrame& frame,
                                  BundleTriangles& out) {
  const D4 d;
  const float e = (kPrecision == Precision::kFast ? 0.5F : 0.25F) * frame.pad;
  for (std::size_t i = 0; i < 4; i += hn::Lanes(d)) {
    const Corners seen(block, i, frame, frame.origin, frame.slope);
    store_edge(seen.c, seen.b, frame.common_origin, i, out.edge[0]);
    store_edge(seen.a, seen.c, frame.common_origin, i, out.edge[1]);
    store_edge(seen.b, seen.a, frame.common_origin, i, out.edge[2]);
    const auto largest = hn::Add(seen.largest(), hn::Set(d, frame.spread + e));
    const auto bound = hn::Mul(largest, hn::MulAdd(largest, hn::Set(d, 0x1p-17F), hn::Set(d, 8.F * e)));
    // Below 2^-120 products lose bits to underflow, which the bound does not count.
    hn::Store(hn::Max(bound, hn::Set(d, 0x1p-120F)), d, out.bound + i);
    hn::Store(seen.s_low(frame), d, out.s_low + i);
    hn::Store(seen.s_high(frame), d, out.s_high + i);
  }
}

/// A bit for each triangle of the block that ray r may hit: what a single ray does (see block_filter-inl.h),
/// for leaves that few rays enter.
template <Precision kPrecision>
HWY_INLINE std::uint32_t filter_block_alone(const TriangleBlock& block, const PacketFrame& frame,
                                            std::uint32_t r) {
  const D4 d;
  const float origin[2] = {frame.ray_origin[0][r], frame.ray_origin[1][r]};
  const float slope[2] = {float(frame.shear[0][r]), float(frame.shear[1][r])};
  const float e = (kPrecision == Precision::kFast ? 0.5F : 0.25F) * frame.pad;
  std::uint32_t rejected = 0;
  for (std::size_t i = 0; i < 4; i += hn::Lanes(d)) {
    const Corners seen(block, i, frame, origin, slope);
    const auto u = hn::NegMulAdd(seen.c.y, seen.b.x, hn::Mul(seen.c.x, seen.b.y));
    const auto v = hn::NegMulAdd(seen.a.y, seen.c.x, hn::Mul(seen.a.x, seen.c.y));
    const auto w = hn::NegMulAdd(seen.b.y, seen.a.x, hn::Mul(seen.b.x, seen.a.y));
    const auto bound =
        hn::Max(hn::Mul(hn::Set(d, 8.F * e), hn::Add(seen.largest(), hn::Set(d, e))), hn::Set(d, 0x1p-120F));
    const auto lowest = hn::Min(u, hn::Min(v, w));
    const auto highest = hn::Max(u, hn::Max(v, w));
    auto reject = hn::And(hn::Lt(lowest, hn::Neg(bound)), hn::Gt(highest, bound));
    reject = hn::Or(reject, hn::Gt(seen.s_low(frame), hn::Set(d, frame.s_far[r])));
    reject = hn::Or(reject, hn::Lt(seen.s_high(frame), hn::Set(d, frame.s_near[r])));
    rejected |= bits_of(d, reject) << i;
  }
  return ~rejected & 0xFU;
}

/// A bit for each ray that may hit triangle `lane` between its s_near and s_far.
template <bool kCommonOrigin>
HWY_INLINE std::uint32_t filter_triangle(const BundleTriangles& t, std::size_t lane,
                                         const PacketFrame& frame) {
  const hn::CappedTag<float, kLanes> d;
  const auto bound = hn::Set(d, t.bound[lane]);
  std::uint32_t outside = 0;
  for (std::size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const auto m = hn::Load(d, frame.slope_delta[0] + i);
    const auto n = hn::Load(d, frame.slope_delta[1] + i);
    const auto edge = [&](int number) HWY_ATTR {
      const auto& term = t.edge[number];
      auto value = hn::MulAdd(m, hn::Set(d, term[1][lane]), hn::Set(d, term[0][lane]));
      value = hn::MulAdd(n, hn::Set(d, term[2][lane]), value);
      if constexpr (!kCommonOrigin) {
        value = hn::MulAdd(hn::Load(d, frame.origin_delta[0] + i), hn::Set(d, term[3][lane]), value);
        value = hn::MulAdd(hn::Load(d, frame.origin_delta[1] + i), hn::Set(d, term[4][lane]), value);
        value = hn::MulAdd(hn::Load(d, frame.twist + i), hn::Set(d, term[5][lane]), value);
      }
      return value;
    };
    const auto u = edge(0);
    const auto v = edge(1);
    const auto w = edge(2);
    const auto lowest = hn::Min(u, hn::Min(v, w));
    const auto highest = hn::Max(u, hn::Max(v, w));
    // Overflow gives NaN or infinity, and then no comparison rejects.
    auto reject = hn::And(hn::Lt(lowest, hn::Neg(bound)), hn::Gt(highest, bound));
    reject = hn::Or(reject, hn::Gt(hn::Set(d, t.s_low[lane]), hn::Load(d, frame.s_far + i)));
    reject = hn::Or(reject, hn::Lt(hn::Set(d, t.s_high[lane]), hn::Load(d, frame.s_near + i)));
    outside |= bits_of(d, reject) << i;
  }
  return ~outside & kAllLanes;
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // toggle
