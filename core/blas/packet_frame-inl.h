// The set-up of a packet, compiled once per instruction set: included by packet_walk-inl.h alone.

#if defined(GRIDCAST_BLAS_PACKET_FRAME_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_PACKET_FRAME_INL_H_
#undef GRIDCAST_BLAS_PACKET_FRAME_INL_H_
#else
#define GRIDCAST_BLAS_PACKET_FRAME_INL_H_
#endif

#include <hwy/highway.h>

#include "core/blas/exact_packet.h"
#include "core/math/bounds.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kLanes = RayPacket::kSize;
constexpr std::uint32_t kAllLanes = (1U << kLanes) - 1;

/// The culling half of sixteen rays that share their main axis z = axes[2] and its sign.
///
/// The origins are moved along their rays to one plane z = plane_z, and distance is measured by s = (z -
/// plane_z)
/// * sign_z, the same for all. With x, y = axes[0], axes[1] a ray is then x = X + slope * (z - plane_z), and
/// as in mesh::ObjectRay every float below is off by less than `pad` = 32 q S, where S bounds what ObjectRay
/// calls S for each of the rays and q = 2^-24: the table in core/README.md holds with one rounding more for
/// the reciprocal.
struct PacketFrame {
  // Per ray.
  alignas(64) float inverse[2][kLanes];      ///< of the change of x or y with s
  alignas(64) float near_offset[2][kLanes];  ///< as in ObjectRay
  alignas(64) float far_offset[2][kLanes];
  alignas(64) float ray_origin[2][kLanes];    ///< (X, Y)
  alignas(64) float slope_delta[2][kLanes];   ///< slope - slope of the middle ray
  alignas(64) float origin_delta[2][kLanes];  ///< (X, Y) - that of the middle ray
  alignas(64) float twist[kLanes];            ///< origin_delta x slope_delta
  alignas(64) float s_near[kLanes];
  alignas(64) float s_far[kLanes];
  alignas(64) double shear[2][kLanes];  ///< slopes, as ObjectRay has them
  alignas(64) double scale[kLanes];     ///< s = t * scale - shift
  alignas(64) double shift[kLanes];

  // The middle ray.
  int axes[3];
  float sign_z, plane_z;
  float origin[2];
  float slope[2];  ///< x per z, at most 1 in size

  // The bundle.
  float pad;
  float spread;        ///< how far a ray can be from the middle one, per axis, over the mesh
  bool mixed[2];       ///< the rays run both ways along this axis
  bool common_origin;  ///< origin_delta is 0 within the pad

  /// s at the near plane b of axis x or y is at least min(b * inverse_low + near_low, b * inverse_high +
  /// near_high) for every ray of the bundle, and likewise the far plane.
  struct Slab {
    float inverse_low, inverse_high;
    float near_low, near_high, far_low, far_high;
  };
  Slab slab[2];
  float near_z, far_z;  ///< s = b * sign_z + near_z or far_z
};

/// Smallest and largest of sixteen.
template <class T>
struct Range {
  T low, high;
  [[nodiscard]] T size() const { return high - low; }
  [[nodiscard]] T middle() const { return T(0.5) * low + T(0.5) * high; }
  [[nodiscard]] T largest() const { return std::max(std::abs(low), std::abs(high)); }
};

template <class T>
HWY_INLINE Range<T> range_of(const T* HWY_RESTRICT values) {
  const hn::CappedTag<T, kLanes> d;
  auto low = hn::Load(d, values);
  auto high = low;
  for (std::size_t i = hn::Lanes(d); i < kLanes; i += hn::Lanes(d)) {
    low = hn::Min(low, hn::Load(d, values + i));
    high = hn::Max(high, hn::Load(d, values + i));
  }
  return {hn::GetLane(hn::MinOfLanes(d, low)), hn::GetLane(hn::MaxOfLanes(d, high))};
}

/// The axis and sign that the direction of every ray is largest along; false when they differ.
HWY_INLINE bool choose_axes(const RayPacket& packet, PacketFrame& frame) {
  const double size[3] = {std::abs(packet.direction[0][0]), std::abs(packet.direction[1][0]),
                          std::abs(packet.direction[2][0])};
  const int z = size[0] >= size[1] ? (size[0] >= size[2] ? 0 : 2) : (size[1] >= size[2] ? 1 : 2);
  frame.axes[2] = z;
  frame.axes[0] = z == 2 ? 0 : z + 1;
  frame.axes[1] = frame.axes[0] == 2 ? 0 : frame.axes[0] + 1;
  frame.sign_z = packet.direction[z][0] >= 0.0 ? 1.F : -1.F;
  const hn::CappedTag<double, kLanes> d;
  const auto sign = hn::Set(d, double(frame.sign_z));
  const auto zero = hn::Zero(d);
  auto bad = hn::Lt(sign, zero);
  bad = hn::Xor(bad, bad);
  for (std::size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const auto along = hn::Mul(sign, hn::Load(d, packet.direction[z] + i));
    for (int axis = 0; axis < 3; ++axis) {
      if (axis == z) continue;
      // Equal components: the first axis counts, as in ObjectRay.
      const auto across = hn::Abs(hn::Load(d, packet.direction[axis] + i));
      bad = hn::Or(bad, axis < z ? hn::Le(along, across) : hn::Lt(along, across));
    }
  }
  return hn::AllFalse(d, bad);
}

using D16 = hn::CappedTag<double, kLanes>;
using F16 = hn::Rebind<float, D16>;

/// The rays moved to the common plane, on the way to a frame.
struct MovedRays {
  Range<double> slopes[2];
  Range<double> z;  ///< before moving
  alignas(64) double origin[2][kLanes];
  Range<double> origins[2];
  double size;  ///< S of the pad: at least what ObjectRay has for each ray, whose origin is moved to the box
};

HWY_INLINE bool set_slopes(const RayPacket& packet, PacketFrame& frame, MovedRays& moved) {
  const D16 d;
  const auto sign = hn::Set(d, double(frame.sign_z));
  for (std::size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const auto scale = hn::Mul(sign, hn::Load(d, packet.direction[frame.axes[2]] + i));
    const auto inverse = hn::Div(sign, scale);
    hn::Store(scale, d, frame.scale + i);
    for (int a = 0; a < 2; ++a)
      hn::Store(hn::Mul(hn::Load(d, packet.direction[frame.axes[a]] + i), inverse), d, frame.shear[a] + i);
  }
  for (int a = 0; a < 2; ++a) moved.slopes[a] = range_of(frame.shear[a]);
  return std::max(moved.slopes[0].size(), moved.slopes[1].size()) <= kMaxPacketSlopes;
}

HWY_INLINE bool move_origins(const RayPacket& packet, const Bounds3f& bounds, PacketFrame& frame,
                             MovedRays& moved) {
  const D16 d;
  const int* axes = frame.axes;
  const auto sign = hn::Set(d, double(frame.sign_z));
  // The common plane is that of the origins, or the near face of the box where they are far from it: floats
  // then have their full resolution at the mesh.
  const double box_size = double(bounds.magnitude());
  moved.z = range_of(packet.origin[axes[2]]);
  const double face = double(frame.sign_z > 0.F ? bounds.lower[axes[2]] : bounds.upper[axes[2]]);
  const bool far_away = std::abs(face - moved.z.middle()) > 16.0 * box_size;
  frame.plane_z = float(far_away ? face : moved.z.middle());
  const double plane_z = double(frame.plane_z);

  for (std::size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const auto step = hn::Sub(hn::Set(d, plane_z), hn::Load(d, packet.origin[axes[2]] + i));
    hn::Store(hn::Mul(step, sign), d, frame.shift + i);
    for (int a = 0; a < 2; ++a) {
      hn::Store(hn::MulAdd(hn::Load(d, frame.shear[a] + i), step, hn::Load(d, packet.origin[axes[a]] + i)), d,
                moved.origin[a] + i);
    }
  }
  double origin_size = moved.z.largest();
  double moved_size = std::abs(plane_z);
  for (int a = 0; a < 2; ++a) {
    moved.origins[a] = range_of(moved.origin[a]);
    moved_size = std::max(moved_size, moved.origins[a].largest());
    origin_size = std::max(origin_size, range_of(packet.origin[axes[a]]).largest());
  }
  const double shift = std::abs(plane_z - moved.z.low) + moved.z.size();
  moved.size = moved_size + 2.0 * box_size + 0x1p-22 * (origin_size + shift);
  const double widest = std::max({moved.origins[0].size(), moved.origins[1].size(), moved.z.size()});
  return widest <= kMaxPacketOrigins * glm::length(Vec3d(bounds.extent()));
}

/// Each ray along axis `a`, by itself and relative to the middle one.
HWY_INLINE void set_axis(const MovedRays& moved, int a, PacketFrame& frame) {
  const D16 d;
  const F16 df;
  const auto sign = hn::Set(d, double(frame.sign_z));
  const auto pad = hn::Set(df, frame.pad);
  frame.origin[a] = float(moved.origins[a].middle());
  frame.slope[a] = float(moved.slopes[a].middle());
  const auto middle_origin = hn::Set(d, double(frame.origin[a]));
  const auto middle_slope = hn::Set(d, double(frame.slope[a]));
  for (std::size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const auto x = hn::Load(d, moved.origin[a] + i);
    const auto slope = hn::Load(d, frame.shear[a] + i);
    hn::Store(hn::DemoteTo(df, hn::Sub(x, middle_origin)), df, frame.origin_delta[a] + i);
    hn::Store(hn::DemoteTo(df, hn::Sub(slope, middle_slope)), df, frame.slope_delta[a] + i);
    // 1 / slope in the direction of s, kept within +-2^24 and away from 0 / 0.
    const auto along = hn::DemoteTo(df, hn::Mul(slope, sign));
    const auto large = hn::CopySign(hn::Set(df, 0x1p24F), along);
    const auto inverse = hn::IfThenElse(hn::Gt(hn::Abs(along), hn::Set(df, 0x1p-24F)),
                                        hn::Div(hn::Set(df, 1.F), along), large);
    const auto start = hn::DemoteTo(df, x);
    const auto offset = hn::Neg(hn::Mul(start, inverse));
    const auto margin = hn::Mul(pad, hn::Abs(inverse));
    hn::Store(start, df, frame.ray_origin[a] + i);
    hn::Store(inverse, df, frame.inverse[a] + i);
    hn::Store(hn::Sub(offset, margin), df, frame.near_offset[a] + i);
    hn::Store(hn::Add(offset, margin), df, frame.far_offset[a] + i);
  }
}

/// The bundle along axis `a`: (b - X) * inverse with X and inverse in ranges. Twice the pad covers the
/// rounding here as well.
HWY_INLINE void set_slab(const MovedRays& moved, int a, PacketFrame& frame) {
  const Range<float> inverse = range_of(frame.inverse[a]);
  frame.mixed[a] = inverse.low < 0.F && inverse.high > 0.F;
  const float half = float(0.5 * moved.origins[a].size() * (1.0 + 0x1p-20));
  const float slack = (half + 2.F * frame.pad) * inverse.largest();
  const float start_low = -(frame.origin[a] * inverse.low);
  const float start_high = -(frame.origin[a] * inverse.high);
  frame.slab[a] = {inverse.low,        inverse.high,      start_low - slack,
                   start_high - slack, start_low + slack, start_high + slack};
}

HWY_INLINE void set_ranges(const RayPacket& packet, PacketFrame& frame) {
  const D16 d;
  const F16 df;
  const auto pad = hn::Set(df, frame.pad);
  const auto grow = hn::Set(d, 0x1p-22);
  for (std::size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
    const auto scale = hn::Load(d, frame.scale + i);
    const auto shift = hn::Load(d, frame.shift + i);
    const auto near = hn::Sub(hn::Mul(hn::Load(d, packet.tnear + i), scale), shift);
    const auto far = hn::Sub(hn::Mul(hn::Load(d, packet.tfar + i), scale), shift);
    const auto low = hn::DemoteTo(df, hn::Sub(near, hn::Mul(hn::Abs(near), grow)));
    const auto high = hn::DemoteTo(df, hn::Add(far, hn::Mul(hn::Abs(far), grow)));
    hn::Store(hn::Sub(low, pad), df, frame.s_near + i);
    hn::Store(hn::Add(high, pad), df, frame.s_far + i);
    const auto turn =
        hn::Mul(hn::Load(df, frame.origin_delta[0] + i), hn::Load(df, frame.slope_delta[1] + i));
    const auto back =
        hn::Mul(hn::Load(df, frame.origin_delta[1] + i), hn::Load(df, frame.slope_delta[0] + i));
    hn::Store(hn::Sub(turn, back), df, frame.twist + i);
  }
  frame.near_z = -(frame.plane_z * frame.sign_z) - frame.pad;
  frame.far_z = -(frame.plane_z * frame.sign_z) + frame.pad;
}

/// Sets `frame` for the rays of `packet`; false when they are too far apart. `bounds` holds the mesh, `drift`
/// is that of the rays, which widens the pad as in ObjectRay::prepare.
HWY_INLINE bool set_up(const RayPacket& packet, const Bounds3f& bounds, double drift, PacketFrame& frame) {
  MovedRays moved;
  if (!choose_axes(packet, frame) || !set_slopes(packet, frame, moved) ||
      !move_origins(packet, bounds, frame, moved))
    return false;
  frame.pad = float(0x1p-19 * moved.size + 0x1p-100 + 16.0 * drift);
  const double apart = 0.5 * std::max(moved.origins[0].size(), moved.origins[1].size());
  const double turned = 0.5 * std::max(moved.slopes[0].size(), moved.slopes[1].size());
  frame.common_origin = apart <= 0x1p-24 * moved.size;
  frame.spread = float((turned * moved.size + apart) * (1.0 + 0x1p-20)) + frame.pad;
  for (int a = 0; a < 2; ++a) {
    set_axis(moved, a, frame);
    set_slab(moved, a, frame);
  }
  set_ranges(packet, frame);
  return true;
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // toggle
