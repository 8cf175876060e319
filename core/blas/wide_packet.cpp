// Packets through the wide tree, compiled once per instruction set and chosen at run time by Highway.
// All of it only culls; the triangle test decides, so hits are those of single rays.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/blas/wide_packet.cpp"  // NOLINT: Highway includes this file once per target

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/blas/packet_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

PacketResult packet_closest_fast(WideView tree, const Bounds3f& box, const RayPacket& p, Hit* h) {
  return PacketWalk<Precision::kFast, false, WideView>(tree, box, p, h).run();
}
PacketResult packet_any_fast(WideView tree, const Bounds3f& box, const RayPacket& p, Hit* h) {
  return PacketWalk<Precision::kFast, true, WideView>(tree, box, p, h).run();
}
PacketResult packet_closest_robust(WideView tree, const Bounds3f& box, const RayPacket& p, Hit* h) {
  return PacketWalk<Precision::kRobust, false, WideView>(tree, box, p, h).run();
}
PacketResult packet_any_robust(WideView tree, const Bounds3f& box, const RayPacket& p, Hit* h) {
  return PacketWalk<Precision::kRobust, true, WideView>(tree, box, p, h).run();
}
PacketResult packet_closest_exact(WideView tree, const Bounds3f& box, const ExactPacket& p,
                                  mesh::ExactBest* h) {
  return PacketWalk<Precision::kExact, false, WideView>(tree, box, p, h).run();
}
PacketResult packet_any_exact(WideView tree, const Bounds3f& box, const ExactPacket& p, mesh::ExactBest* h) {
  return PacketWalk<Precision::kExact, true, WideView>(tree, box, p, h).run();
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::blas {

HWY_EXPORT(packet_closest_fast);
HWY_EXPORT(packet_any_fast);
HWY_EXPORT(packet_closest_robust);
HWY_EXPORT(packet_any_robust);
HWY_EXPORT(packet_closest_exact);
HWY_EXPORT(packet_any_exact);

template <Precision kPrecision, bool kAnyHit>
PacketResult WideBvh::intersect_packet(const Bounds3f& bounds, const PacketOf<kPrecision>& packet,
                                       BestOf<kPrecision>* best) const {
  if (nodes().empty()) return {true, 0};
  const WideView tree = view_of(*this);
  if constexpr (kPrecision == Precision::kExact) {
    if constexpr (kAnyHit) return HWY_DYNAMIC_DISPATCH(packet_any_exact)(tree, bounds, packet, best);
    return HWY_DYNAMIC_DISPATCH(packet_closest_exact)(tree, bounds, packet, best);
  } else if constexpr (kPrecision == Precision::kFast) {
    if constexpr (kAnyHit) return HWY_DYNAMIC_DISPATCH(packet_any_fast)(tree, bounds, packet, best);
    return HWY_DYNAMIC_DISPATCH(packet_closest_fast)(tree, bounds, packet, best);
  } else {
    if constexpr (kAnyHit) return HWY_DYNAMIC_DISPATCH(packet_any_robust)(tree, bounds, packet, best);
    return HWY_DYNAMIC_DISPATCH(packet_closest_robust)(tree, bounds, packet, best);
  }
}

template PacketResult WideBvh::intersect_packet<Precision::kFast, false>(const Bounds3f&, const RayPacket&,
                                                                         Hit*) const;
template PacketResult WideBvh::intersect_packet<Precision::kFast, true>(const Bounds3f&, const RayPacket&,
                                                                        Hit*) const;
template PacketResult WideBvh::intersect_packet<Precision::kRobust, false>(const Bounds3f&, const RayPacket&,
                                                                           Hit*) const;
template PacketResult WideBvh::intersect_packet<Precision::kRobust, true>(const Bounds3f&, const RayPacket&,
                                                                          Hit*) const;
template PacketResult WideBvh::intersect_packet<Precision::kExact, false>(const Bounds3f&, const ExactPacket&,
                                                                          mesh::ExactBest*) const;
template PacketResult WideBvh::intersect_packet<Precision::kExact, true>(const Bounds3f&, const ExactPacket&,
                                                                         mesh::ExactBest*) const;

}  // namespace gridcast::blas
#endif  // HWY_ONCE
