// Packets through the compact tree, compiled once per instruction set and chosen at run time by Highway.
// All of it only culls; the triangle test decides, so hits are those of single rays.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/blas/compact_packet.cpp"  // NOLINT: Highway includes this file once per target

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/blas/compact_bvh.h"
#include "core/blas/packet_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

PacketResult packet_closest_fast(const CompactView& tree, const Bounds3f& box, const RayPacket& p, Hit* h) {
  return PacketWalk<Precision::kFast, false, CompactView>(tree, box, p, h).run();
}
PacketResult packet_any_fast(const CompactView& tree, const Bounds3f& box, const RayPacket& p, Hit* h) {
  return PacketWalk<Precision::kFast, true, CompactView>(tree, box, p, h).run();
}
PacketResult packet_closest_robust(const CompactView& tree, const Bounds3f& box, const RayPacket& p, Hit* h) {
  return PacketWalk<Precision::kRobust, false, CompactView>(tree, box, p, h).run();
}
PacketResult packet_any_robust(const CompactView& tree, const Bounds3f& box, const RayPacket& p, Hit* h) {
  return PacketWalk<Precision::kRobust, true, CompactView>(tree, box, p, h).run();
}
PacketResult packet_closest_exact(const CompactView& tree, const Bounds3f& box, const ExactPacket& p,
                                  mesh::ExactBest* h) {
  return PacketWalk<Precision::kExact, false, CompactView>(tree, box, p, h).run();
}
PacketResult packet_any_exact(const CompactView& tree, const Bounds3f& box, const ExactPacket& p,
                              mesh::ExactBest* h) {
  return PacketWalk<Precision::kExact, true, CompactView>(tree, box, p, h).run();
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
PacketResult CompactBvh::intersect_packet(const mesh::TriangleMesh& mesh, const Bounds3f& bounds,
                                          const PacketOf<kPrecision>& packet,
                                          BestOf<kPrecision>* best) const {
  if (nodes_.empty()) return {true, 0};
  const CompactView tree = view(mesh);
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

template PacketResult CompactBvh::intersect_packet<Precision::kFast, false>(const mesh::TriangleMesh&,
                                                                            const Bounds3f&, const RayPacket&,
                                                                            Hit*) const;
template PacketResult CompactBvh::intersect_packet<Precision::kFast, true>(const mesh::TriangleMesh&,
                                                                           const Bounds3f&, const RayPacket&,
                                                                           Hit*) const;
template PacketResult CompactBvh::intersect_packet<Precision::kRobust, false>(const mesh::TriangleMesh&,
                                                                              const Bounds3f&,
                                                                              const RayPacket&, Hit*) const;
template PacketResult CompactBvh::intersect_packet<Precision::kRobust, true>(const mesh::TriangleMesh&,
                                                                             const Bounds3f&,
                                                                             const RayPacket&, Hit*) const;
template PacketResult CompactBvh::intersect_packet<Precision::kExact, false>(const mesh::TriangleMesh&,
                                                                             const Bounds3f&,
                                                                             const ExactPacket&,
                                                                             mesh::ExactBest*) const;
template PacketResult CompactBvh::intersect_packet<Precision::kExact, true>(const mesh::TriangleMesh&,
                                                                            const Bounds3f&,
                                                                            const ExactPacket&,
                                                                            mesh::ExactBest*) const;

}  // namespace gridcast::blas
#endif  // HWY_ONCE
