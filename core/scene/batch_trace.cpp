#include "core/scene/batch_trace.h"

#include <algorithm>
#include <cmath>

#include "core/blas/exact_packet.h"
#include "core/scene/trace_one.h"

namespace gridcast::scene {
namespace {

using blas::ExactPacket;
using blas::PacketResult;
using blas::RayPacket;

/// A quick look at the two ends of sixteen rays, before any work is done for them together; the packet's own
/// set-up looks at all.
bool may_be_close(const Ray& a, const Ray& b) {
  const double size_a = max_abs(a.direction);
  const double size_b = max_abs(b.direction);
  return max_abs(a.direction * size_b - b.direction * size_a) <=
         2.0 * blas::kMaxPacketSlopes * size_a * size_b;
}

bool set_lane(const BatchTarget& target, const Ray& ray, std::size_t lane, RayPacket& packet) {
  const InstanceTransform& transform = target.sole->transform;
  packet.set(lane, {transform.point_to_object(ray.origin), transform.vector_to_object(ray.direction),
                    ray.tnear, ray.tfar});
  return true;
}
bool set_lane(const BatchTarget& target, const Ray& ray, std::size_t lane, ExactPacket& packet) {
  const blas::Blas& blas = target.scene.blas(target.sole->mesh_id);
  packet.world_from_object = &target.sole->transform.world_from_object();
  packet.mesh = &blas.mesh();
  return packet.set_image(lane, ray, mesh::exact_image(ray, target.sole->transform, blas.bounds()));
}

/// Fills the packet's lanes with the rays `index[0 .. count)` in the object space of the target's only
/// instance. False when one of them cannot go with others.
template <class Packet>
bool fill_packet(const BatchTarget& target, const RayRun& run, const std::uint32_t* index, Packet& packet) {
  for (std::size_t lane = 0; lane < RayPacket::kSize; ++lane) {
    const std::size_t i = index[std::min(lane, std::size_t(packet.count) - 1)];
    if (!set_lane(target, run.rays[i], lane, packet)) return false;
    const PrimitiveRef excluded = run.excluded.empty() ? PrimitiveRef{} : run.excluded[i];
    packet.excluded_primitive[lane] =
        excluded.instance_id == target.sole_id ? excluded.primitive_id : kInvalidId;
  }
  packet.instance_id = target.sole_id;
  return true;
}

/// Whether a valid ray hits the target's only instance, which it sees; keeps the closest hit in `best` unless
/// any will do.
template <Precision kPrecision, bool kAnyHit>
bool trace_sole(const BatchTarget& target, const Ray& ray, const PrimitiveRef& excluded, Hit& best) {
  const blas::Blas& blas = target.scene.blas(target.sole->mesh_id);
  mesh::ObjectRay object_ray;
  if (!prepare_for(object_ray, target.sole->transform, blas, ray, ray.tfar, target.sole_id, excluded))
    return false;
  if constexpr (kAnyHit)
    return blas.template occluded<kPrecision>(object_ray, ray.tfar);
  else
    return blas.template intersect<kPrecision>(object_ray, best);
}

template <Precision kPrecision, bool kAnyHit>
bool trace_whole(const BatchTarget& target, const Ray& ray, const QueryFilter& filter, Hit& best) {
  if constexpr (kAnyHit) {
    return any_hit<kPrecision>(target.scene, ray, filter);
  } else {
    closest_hit<kPrecision>(target.scene, ray, filter, best);
    return best.valid();
  }
}

template <Precision kPrecision, bool kAnyHit>
void trace_single(const BatchTarget& target, RayRun& run, std::size_t i) {
  const Ray& ray = run.rays[i];
  const QueryFilter filter{run.excluded.empty() ? PrimitiveRef{} : run.excluded[i], target.mask};
  Hit none;
  Hit& best = kAnyHit ? none : run.hits[i];
  bool hit = false;
  if constexpr (kPrecision == Precision::kExact) {
    hit = trace_whole<kPrecision, kAnyHit>(target, ray, filter, best);
  } else {
    hit = target.sole != nullptr ? trace_sole<kPrecision, kAnyHit>(target, ray, filter.excluded, best)
                                 : trace_whole<kPrecision, kAnyHit>(target, ray, filter, best);
  }
  run.status[i] = hit ? RayStatus::kHit : RayStatus::kMiss;
  ++run.single_rays;
}

/// The packet of the rays index[0 .. count); keeps their closest hits.
template <Precision kPrecision, bool kAnyHit>
PacketResult trace_packet(const BatchTarget& target, blas::PacketOf<kPrecision>& packet, RayRun& run,
                          const std::uint32_t* index) {
  constexpr bool kExact = kPrecision == Precision::kExact;
  const blas::Blas& blas = target.scene.blas(target.sole->mesh_id);
  if constexpr (kAnyHit) {
    if constexpr (kExact)
      return blas::occluded_packet_exact(blas, packet);
    else
      return blas.template occluded_packet<kPrecision>(packet);
  } else {
    blas::BestOf<kPrecision> best[RayPacket::kSize];
    PacketResult result;
    if constexpr (kExact) {
      for (std::uint32_t lane = 0; lane < RayPacket::kSize; ++lane)
        best[lane] = mesh::ExactBest(packet.tfar[lane]);
      packet.best = best;
      result = blas::intersect_packet_exact(blas, packet);
    } else {
      for (std::uint32_t lane = 0; lane < RayPacket::kSize; ++lane) best[lane].t = packet.tfar[lane];
      result = blas.template intersect_packet<kPrecision>(packet, best);
    }
    for (std::uint32_t lane = 0; result.traced && lane < packet.count; ++lane) {
      if constexpr (kExact)
        finish_exact(run.rays[index[lane]], best[lane], run.hits[index[lane]]);
      else
        run.hits[index[lane]] = best[lane];
    }
    return result;
  }
}

/// The rays index[0 .. count) together. False when they are too far apart.
template <Precision kPrecision, bool kAnyHit>
bool trace_together(const BatchTarget& target, RayRun& run, const std::uint32_t* index, std::uint32_t count) {
  if (!may_be_close(run.rays[index[0]], run.rays[index[count - 1]])) return false;
  blas::PacketOf<kPrecision> packet;
  packet.count = count;
  if (!fill_packet(target, run, index, packet)) return false;
  const PacketResult result = trace_packet<kPrecision, kAnyHit>(target, packet, run, index);
  if (!result.traced) return false;
  for (std::uint32_t lane = 0; lane < count; ++lane)
    run.status[index[lane]] = (result.hits >> lane & 1U) != 0 ? RayStatus::kHit : RayStatus::kMiss;
  run.packet_rays += count;
  return true;
}

/// Fewer rays than this are not worth a packet's set-up.
constexpr std::uint32_t kFewestTogether = 4;

}  // namespace

BatchTarget::BatchTarget(const Scene& whole, InstanceMask query_mask) : scene(whole), mask(query_mask) {
  const std::optional<std::uint32_t> id = whole.top_level().sole_instance();
  if (!id || !whole.instance(*id).seen_by(mask)) return;
  sole = &whole.instance(*id);
  sole_id = *id;
}

void RayRun::load(const RayBatch& batch, std::span<const std::uint32_t> permutation, std::size_t begin,
                  std::size_t end) {
  const std::size_t count = end - begin;
  rays.resize(count);
  excluded.resize(batch.excluded.empty() ? 0 : count);
  const auto source = [&](std::size_t i) {
    return permutation.empty() ? begin + i : std::size_t(permutation[begin + i]);
  };
  // The rows of a permutation are all over memory: ask for them early.
  constexpr std::size_t kAhead = 16;
  for (std::size_t i = 0; i < count; ++i) {
    if (!permutation.empty() && i + kAhead < count)
      __builtin_prefetch(batch.bytes.data() + source(i + kAhead) * batch.row_bytes());
    rays[i] = batch[source(i)];
  }
  for (std::size_t i = 0; i < excluded.size(); ++i) {
    const std::size_t k = source(i);
    excluded[i] = k < batch.excluded.size() ? batch.excluded[k] : PrimitiveRef{};
  }
}

template <Precision kPrecision, bool kAnyHit>
bool trace_run(const BatchTarget& target, RayRun& run, const std::stop_token& stop) {
  const std::size_t count = run.rays.size();
  run.status.resize(count);
  if constexpr (!kAnyHit) run.hits.resize(count);
  const bool packets = target.sole != nullptr && target.scene.blas(target.sole->mesh_id).has_packets();
  std::uint32_t together[RayPacket::kSize];
  std::uint32_t waiting = 0;
  bool stopped = false;
  const auto trace_alone = [&](std::size_t i) {
    stopped = stopped || stop.stop_requested();
    if (!stopped) trace_single<kPrecision, kAnyHit>(target, run, i);
  };
  const auto flush = [&] {
    stopped = stopped || stop.stop_requested();
    const bool traced = stopped || (waiting >= kFewestTogether &&
                                    trace_together<kPrecision, kAnyHit>(target, run, together, waiting));
    for (std::uint32_t k = 0; k < waiting && !traced; ++k) trace_alone(together[k]);
    waiting = 0;
  };
  for (std::size_t i = 0; i < count && !stopped; ++i) {
    if constexpr (!kAnyHit) run.hits[i] = Hit{.t = run.rays[i].tfar};
    if (!is_valid(run.rays[i])) {
      run.status[i] = RayStatus::kInvalid;
    } else if (packets) {
      together[waiting++] = std::uint32_t(i);
      if (waiting == RayPacket::kSize) flush();
    } else {
      trace_alone(i);
    }
  }
  flush();
  return !stopped;
}

template bool trace_run<Precision::kFast, false>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kFast, true>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kRobust, false>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kRobust, true>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kExact, false>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kExact, true>(const BatchTarget&, RayRun&, const std::stop_token&);

}  // namespace gridcast::scene
