// The triangle test for several rays of a packet at once, compiled once per instruction set: included by the
// packet kernels alone.

#if defined(GRIDCAST_BLAS_PACKET_DECIDE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_PACKET_DECIDE_INL_H_
#undef GRIDCAST_BLAS_PACKET_DECIDE_INL_H_
#else
#define GRIDCAST_BLAS_PACKET_DECIDE_INL_H_
#endif

#include <cmath>

#include <hwy/highway.h>

#include "core/blas/packet_frame-inl.h"
#include "core/math/exact_lanes-inl.h"
#include "core/mesh/triangle_test.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// What mesh::intersect_triangle_robust says of several rays and one triangle.
struct DecidedRays {
  static constexpr std::size_t kMost = 8;

  std::uint32_t hit = 0;        ///< a bit for each ray, from the first on
  std::uint32_t undecided = 0;  ///< of these nothing is known: a side is too near 0 for doubles
  alignas(64) double t[kMost];
  alignas(64) double u[kMost];
  alignas(64) double v[kMost];
};

using DecideTag = hn::CappedTag<double, DecidedRays::kMost>;
using DecideLanes = hn::Vec<DecideTag>;

/// The rays from `first` on, as many as there are lanes, with a triangle in the order of the frame's axes.
/// The operations of mesh::intersect_triangle_robust in their order, but for its quick rejection, which only
/// saves time.
HWY_INLINE void intersect_many(const RayPacket& packet, const PacketFrame& frame, double mesh_size,
                               const mesh::AxesTriangle& triangle, std::size_t first, DecidedRays& out) {
  const DecideTag d;
  const DecideLanes origin[3] = {hn::Load(d, packet.origin[frame.axes[0]] + first),
                                 hn::Load(d, packet.origin[frame.axes[1]] + first),
                                 hn::Load(d, packet.origin[frame.axes[2]] + first)};
  const DecideLanes shear_x = hn::Load(d, frame.shear[0] + first);
  const DecideLanes shear_y = hn::Load(d, frame.shear[1] + first);
  struct Sheared {
    DecideLanes x, y, z;
  };
  const auto shear = [&](const Vec3f& p) HWY_ATTR {
    const DecideLanes z = hn::Sub(hn::Set(d, double(p.z)), origin[2]);
    return Sheared{hn::Sub(hn::Sub(hn::Set(d, double(p.x)), origin[0]), hn::Mul(shear_x, z)),
                   hn::Sub(hn::Sub(hn::Set(d, double(p.y)), origin[1]), hn::Mul(shear_y, z)), z};
  };
  const Sheared a = shear(triangle.p0), b = shear(triangle.p1), c = shear(triangle.p2);
  const DecideLanes u = gridcast::HWY_NAMESPACE::difference_of_products(d, c.x, b.y, c.y, b.x);
  const DecideLanes v = gridcast::HWY_NAMESPACE::difference_of_products(d, a.x, c.y, a.y, c.x);
  const DecideLanes w = gridcast::HWY_NAMESPACE::difference_of_products(d, b.x, a.y, b.y, a.x);

  const auto largest_of = [](DecideLanes x, DecideLanes y, DecideLanes z)
                              HWY_ATTR { return hn::Max(hn::Max(hn::Abs(x), hn::Abs(y)), hn::Abs(z)); };
  const DecideLanes m = hn::Max(largest_of(a.x, b.x, c.x), largest_of(a.y, b.y, c.y));
  const DecideLanes distance = hn::Add(largest_of(origin[0], origin[1], origin[2]), hn::Set(d, mesh_size));
  const DecideLanes e = hn::Mul(hn::Set(d, 0x1p-50), distance);
  const DecideLanes bound = hn::Mul(hn::Mul(hn::Set(d, 8.0), e), hn::Add(m, e));
  const DecideLanes smallest = hn::Min(hn::Min(hn::Abs(u), hn::Abs(v)), hn::Abs(w));
  const auto near_zero = hn::Not(hn::Gt(smallest, bound));
  const DecideLanes lowest = hn::Min(hn::Min(u, v), w), highest = hn::Max(hn::Max(u, v), w);
  const auto outside = hn::And(hn::Lt(lowest, hn::Zero(d)), hn::Gt(highest, hn::Zero(d)));

  const DecideLanes determinant = hn::Add(hn::Add(u, v), w);
  const DecideLanes z = hn::Add(
      a.z, hn::Div(hn::Add(hn::Mul(v, hn::Sub(b.z, a.z)), hn::Mul(w, hn::Sub(c.z, a.z))), determinant));
  // Of equal operands the second is taken, as std::min and std::max take their first.
  const DecideLanes nearest = hn::Min(c.z, hn::Min(b.z, a.z));
  const DecideLanes farthest = hn::Max(c.z, hn::Max(b.z, a.z));
  const DecideLanes depth = hn::Min(farthest, hn::Max(nearest, z));
  hn::Store(hn::Div(depth, hn::Load(d, packet.direction[frame.axes[2]] + first)), d, out.t);
  hn::Store(hn::Div(v, determinant), d, out.u);
  hn::Store(hn::Div(w, determinant), d, out.v);

  const auto bits = [&](auto mask) HWY_ATTR {
    std::uint8_t bytes[8] = {0};
    hn::StoreMaskBits(d, mask, bytes);
    return std::uint32_t(bytes[0]);
  };
  out.undecided = bits(near_zero);
  out.hit = ~(out.undecided | bits(outside)) & ((1U << hn::Lanes(d)) - 1);
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // toggle
