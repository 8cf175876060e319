#include "core/scene/group_trace.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "core/scene/trace_one.h"

namespace gridcast::scene {
namespace {

constexpr double kNothing = -std::numeric_limits<double>::infinity();

/// Fewer rays than this are not worth a packet's set-up.
constexpr int kFewestTogether = 4;

/// Among instances rays go together while they are at most so many triangles of the mesh apart, if those
/// covered a square as large as the instance's box. Beyond, the packet visits so much more than each ray
/// that single rays are faster: 69 k triangles gained 1.15 to 1.3 at 5 to 20, and lost as much at 30 to 80.
constexpr double kMaxTrianglesApart = 16.0;

/// A quick look at the two ends of a group.
bool may_be_close(const Ray& a, const Ray& b) {
  const double size_a = max_abs(a.direction);
  const double size_b = max_abs(b.direction);
  return max_abs(a.direction * size_b - b.direction * size_a) <=
         2.0 * blas::kMaxPacketSlopes * size_a * size_b;
}

}  // namespace

template <Precision kPrecision, bool kAnyHit>
bool GroupTracer<kPrecision, kAnyHit>::trace(std::span<const std::uint32_t> index, bool packets) {
  packets_ = packets;
  index_ = index.data();
  hits_ = together_ = 0;
  double far[tlas::kGroupSize];
  const auto count = std::uint32_t(index.size());
  for (std::uint32_t ray = 0; ray < count; ++ray) {
    rays_[ray] = &run_.rays[index[ray]];
    far[ray] = rays_[ray]->tfar;
    if (!target_.is_alone) directions_[ray] = rays_[ray]->direction * (1.0 / max_abs(rays_[ray]->direction));
    if constexpr (kAnyHit)
      continue;
    else if constexpr (kExact)
      best_[ray] = mesh::ExactBest(far[ray]);
    else
      best_[ray] = Hit{.t = far[ray]};
  }
  target_.scene.top_level().traverse_group({rays_.data(), count}, far, Visitor{*this});
  if (stopped()) return false;
  for (std::uint32_t ray = 0; ray < count; ++ray) finish(ray, index[ray]);
  const auto packet_rays = std::uint32_t(std::popcount(together_));
  run_.packet_rays += packet_rays;
  run_.single_rays += count - packet_rays;
  return true;
}

template <Precision kPrecision, bool kAnyHit>
void GroupTracer<kPrecision, kAnyHit>::finish(std::uint32_t ray, std::uint32_t i) {
  if constexpr (kAnyHit) {
    run_.status[i] = (hits_ >> ray & 1U) != 0 ? RayStatus::kHit : RayStatus::kMiss;
  } else {
    Hit& hit = run_.hits[i];
    if constexpr (kExact)
      finish_exact(*rays_[ray], best_[ray], hit);
    else
      hit = best_[ray];
    run_.status[i] = hit.valid() ? RayStatus::kHit : RayStatus::kMiss;
  }
}

template <Precision kPrecision, bool kAnyHit>
void GroupTracer<kPrecision, kAnyHit>::prefetch(std::uint32_t instance_id) const {
  target_.scene.prefetch_instance(instance_id);
}

template <Precision kPrecision, bool kAnyHit>
void GroupTracer<kPrecision, kAnyHit>::visit(std::uint32_t instance_id, std::uint32_t rays, double* far) {
  const Instance instance = target_.scene.instance(instance_id);
  if (!instance.seen_by(target_.mask)) return;
  const GroupPlace place{instance_id, instance, target_.scene.blas(instance.mesh_id)};
  if (packets_ && !stopped() && visit_together(place, rays, far)) return;
  for (; rays != 0; rays &= rays - 1) visit_alone(place, std::uint32_t(std::countr_zero(rays)), far);
}

template <Precision kPrecision, bool kAnyHit>
std::uint32_t GroupTracer<kPrecision, kAnyHit>::excluded_in(const GroupPlace& place,
                                                            std::uint32_t ray) const {
  if (run_.excluded.empty()) return kInvalidId;
  const PrimitiveRef& excluded = run_.excluded[index_[ray]];
  return excluded.instance_id == place.instance_id ? excluded.primitive_id : kInvalidId;
}

/// Whether it is worth trying to send rays through the instance's tree together: a look at the world, before
/// any work is done for them; the packet's own set-up looks closer.
template <Precision kPrecision, bool kAnyHit>
bool GroupTracer<kPrecision, kAnyHit>::may_share(const GroupPlace& place, std::uint32_t rays) const {
  if (!place.blas.has_packets()) return false;
  const auto first = std::size_t(std::countr_zero(rays));
  if (target_.is_alone) return may_be_close(*rays_[first], *rays_[std::size_t(std::bit_width(rays) - 1)]);
  double turn = 0.0, shift = 0.0;
  for (std::uint32_t rest = rays & (rays - 1); rest != 0; rest &= rest - 1) {
    const auto ray = std::size_t(std::countr_zero(rest));
    turn = std::max(turn, max_abs(directions_[ray] - directions_[first]));
    shift = std::max(shift, max_abs(rays_[ray]->origin - rays_[first]->origin));
  }
  if (turn > 2.0 * blas::kMaxPacketSlopes) return false;
  const Bounds3d& box = target_.scene.top_level().box(place.instance_id).bounds;
  const double apart = shift + turn * max_abs(rays_[first]->origin - box.center());
  const double triangles = std::sqrt(double(place.blas.mesh().triangle_count()));
  return apart * triangles <= kMaxTrianglesApart * glm::length(box.extent());
}

/// False when the ray cannot go with others.
template <Precision kPrecision, bool kAnyHit>
bool GroupTracer<kPrecision, kAnyHit>::set_lane(const GroupPlace& place, std::uint32_t ray, std::size_t lane,
                                                Packet& packet) const {
  const InstanceTransform& transform = place.instance.transform;
  const Ray& world = *rays_[ray];
  packet.excluded_primitive[lane] = excluded_in(place, ray);
  if constexpr (kExact) {
    return packet.set_image(lane, world, mesh::exact_image(world, transform, place.blas.bounds()));
  } else {
    packet.set(lane, {transform.point_to_object(world.origin), transform.vector_to_object(world.direction),
                      world.tnear, world.tfar});
    return true;
  }
}

template <Precision kPrecision, bool kAnyHit>
blas::PacketResult GroupTracer<kPrecision, kAnyHit>::trace_packet(const GroupPlace& place, Packet& packet,
                                                                  Best* best) const {
  if constexpr (kExact) {
    packet.world_from_object = &place.instance.transform.world_from_object();
    packet.mesh = &place.blas.mesh();
    packet.best = best;
    if constexpr (kAnyHit) return blas::occluded_packet_exact(place.blas, packet);
    return blas::intersect_packet_exact(place.blas, packet);
  } else {
    if constexpr (kAnyHit) return place.blas.template occluded_packet<kPrecision>(packet);
    return place.blas.template intersect_packet<kPrecision>(packet, best);
  }
}

/// The rays as one packet. False when they are too few or too far apart: then nothing was done.
template <Precision kPrecision, bool kAnyHit>
bool GroupTracer<kPrecision, kAnyHit>::visit_together(const GroupPlace& place, std::uint32_t rays,
                                                      double* far) {
  const int count = std::popcount(rays);
  if (count < kFewestTogether || !may_share(place, rays)) return false;
  const auto last = std::uint32_t(std::bit_width(rays) - 1);
  Packet packet;
  packet.count = std::uint32_t(count);
  packet.instance_id = place.instance_id;
  std::uint32_t ray_of[tlas::kGroupSize];
  Best best[kAnyHit ? 1 : tlas::kGroupSize];
  std::uint32_t rest = rays;
  for (std::size_t lane = 0; lane < tlas::kGroupSize; ++lane) {
    const std::uint32_t ray = rest != 0 ? std::uint32_t(std::countr_zero(rest)) : last;
    rest &= rest - 1;
    ray_of[lane] = ray;
    if (!set_lane(place, ray, lane, packet)) return false;
    packet.tfar[lane] = far[ray];
    if constexpr (!kAnyHit) best[lane] = best_[ray];
  }
  const blas::PacketResult result = trace_packet(place, packet, best);
  if (!result.traced) return false;
  together_ |= rays;
  visits_.together += std::uint64_t(count);
  visits_.together_steps += result.steps;
  if (kAnyHit && target_.is_alone) {  // lanes are rays, and nothing comes after
    hits_ |= result.hits;
    return true;
  }
  for (std::uint32_t hits = result.hits; hits != 0; hits &= hits - 1) {
    const auto lane = std::size_t(std::countr_zero(hits));
    if constexpr (!kAnyHit) best_[ray_of[lane]] = best[lane];
    keep(ray_of[lane], far);
  }
  return true;
}

/// A hit of the ray was found: what is still of interest to it.
template <Precision kPrecision, bool kAnyHit>
void GroupTracer<kPrecision, kAnyHit>::keep(std::uint32_t ray, double* far) {
  hits_ |= 1U << ray;
  if constexpr (kAnyHit)
    far[ray] = kNothing;
  else if constexpr (kExact)
    far[ray] = best_[ray].upper;
  else
    far[ray] = best_[ray].t;
}

/// Adds the ray to the stream unless it misses the mesh's box.
template <Precision kPrecision, bool kAnyHit>
void GroupTracer<kPrecision, kAnyHit>::visit_alone(const GroupPlace& place, std::uint32_t ray, double* far) {
  if (stopped()) {
    far[ray] = kNothing;
    return;
  }
  ++visits_.alone;
  if (!prepare(place, ray, far[ray])) return;
  blas::StreamRay<kPrecision>& added = stream_[stream_size_];
  added = {&place.blas, &object_rays_[stream_size_], nullptr, far[ray]};
  if constexpr (!kAnyHit) added.best = &best_[ray];
  ray_of_[stream_size_++] = ray;
}

/// The next object ray of the stream. False when it misses the mesh's box.
template <Precision kPrecision, bool kAnyHit>
bool GroupTracer<kPrecision, kAnyHit>::prepare(const GroupPlace& place, std::uint32_t ray, double far) {
  const InstanceTransform& transform = place.instance.transform;
  mesh::ObjectRay& object_ray = object_rays_[stream_size_];
  const PrimitiveRef excluded{place.instance_id, excluded_in(place, ray)};
  if constexpr (kExact) {
    mesh::ExactRay& exact_ray = exact_rays_[stream_size_];
    const blas::Blas& blas = place.blas;
    if (!exact_ray.prepare(object_ray, *rays_[ray], transform, blas.mesh(), blas.bounds(), far)) return false;
    object_ray.instance_id = place.instance_id;
    object_ray.excluded_primitive = excluded.primitive_id;
    return true;
  } else {
    return prepare_for(object_ray, transform, place.blas, *rays_[ray], far, place.instance_id, excluded);
  }
}

template <Precision kPrecision, bool kAnyHit>
void GroupTracer<kPrecision, kAnyHit>::trace_stream(double* far) {
  const std::span<const blas::StreamRay<kPrecision>> rays(stream_.data(), std::exchange(stream_size_, 0));
  if (rays.empty()) return;
  blas::StreamResult result;
  if constexpr (kAnyHit)
    result = blas::occluded_stream<kPrecision>(rays);
  else
    result = blas::intersect_stream<kPrecision>(rays);
  visits_.alone_steps += result.steps;
  for (std::uint32_t hits = result.hits; hits != 0; hits &= hits - 1)
    keep(ray_of_[std::size_t(std::countr_zero(hits))], far);
}

template class GroupTracer<Precision::kFast, false>;
template class GroupTracer<Precision::kFast, true>;
template class GroupTracer<Precision::kRobust, false>;
template class GroupTracer<Precision::kRobust, true>;
template class GroupTracer<Precision::kExact, false>;
template class GroupTracer<Precision::kExact, true>;

}  // namespace gridcast::scene
