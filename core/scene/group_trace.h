#pragma once
// Up to sixteen rays of a batch on their way together: through the top level side by side, and through the
// tree of an instance as a packet where enough of them come to it and are close.

#include <array>
#include <cstdint>
#include <span>
#include <stop_token>
#include <utility>

#include "core/blas/exact_packet.h"
#include "core/blas/ray_stream.h"
#include "core/scene/batch_trace.h"
#include "core/tlas/group_visitor.h"

namespace gridcast::scene {

/// An instance that rays come to.
struct GroupPlace {
  std::uint32_t instance_id;
  const Instance& instance;
  const blas::Blas& blas;
};

/// Traces groups of a run one after the other.
template <Precision kPrecision, bool kAnyHit>
class GroupTracer {
 public:
  GroupTracer(const BatchTarget& target, RayRun& run, const std::stop_token& stop)
      : target_(target), run_(run), stop_(stop) {}

  /// Answers the rays index[0 .. size) of the run, which are valid; at most kGroupSize. Without `packets`
  /// each goes for itself, side by side with the others. False when stopped on the way: then there are no
  /// answers.
  bool trace(std::span<const std::uint32_t> index, bool packets);

  /// What came of the groups since the last call.
  GroupVisits take_visits() { return std::exchange(visits_, {}); }

 private:
  using Packet = blas::PacketOf<kPrecision>;
  using Best = blas::BestOf<kPrecision>;
  static constexpr bool kExact = kPrecision == Precision::kExact;
  struct NoExactRay {};

  /// For TopLevel::traverse_group.
  struct Visitor {
    GroupTracer& tracer;
    void visit(std::uint32_t id, std::uint32_t rays, double* far) const { tracer.visit(id, rays, far); }
    void finish(double* far) const { tracer.trace_stream(far); }
    void prefetch(std::uint32_t id) const { tracer.prefetch(id); }
    [[nodiscard]] bool goes_on() const { return !tracer.stopped(); }
  };
  void visit(std::uint32_t instance_id, std::uint32_t rays, double* far);
  void prefetch(std::uint32_t instance_id) const;
  bool stopped() { return stopped_ = stopped_ || stop_.stop_requested(); }
  bool visit_together(const GroupPlace& place, std::uint32_t rays, double* far);
  [[nodiscard]] bool may_share(const GroupPlace& place, std::uint32_t rays) const;
  bool set_lane(const GroupPlace& place, std::uint32_t ray, std::size_t lane, Packet& packet) const;
  blas::PacketResult trace_packet(const GroupPlace& place, Packet& packet, Best* best) const;
  void visit_alone(const GroupPlace& place, std::uint32_t ray, double* far);
  bool prepare(const GroupPlace& place, std::uint32_t ray, double far);
  void trace_stream(double* far);
  void keep(std::uint32_t ray, double* far);
  void finish(std::uint32_t ray, std::uint32_t i);
  [[nodiscard]] std::uint32_t excluded_in(const GroupPlace& place, std::uint32_t ray) const;

  const BatchTarget& target_;
  RayRun& run_;
  const std::stop_token& stop_;
  const std::uint32_t* index_ = nullptr;
  std::array<const Ray*, tlas::kGroupSize> rays_{};
  std::array<Vec3d, tlas::kGroupSize> directions_;  ///< largest component 1; among instances
  std::array<Best, tlas::kGroupSize> best_;         ///< of closest hits
  std::uint32_t hits_ = 0;                          ///< a bit for each ray of which a hit is known
  std::uint32_t together_ = 0;                      ///< rays that were in a packet
  // Rays that have come to an instance, and not in a packet.
  std::array<blas::StreamRay<kPrecision>, blas::kStreamSize> stream_;
  std::array<mesh::ObjectRay, blas::kStreamSize> object_rays_;
  std::array<std::conditional_t<kExact, mesh::ExactRay, NoExactRay>, blas::kStreamSize> exact_rays_;
  std::array<std::uint32_t, blas::kStreamSize> ray_of_;
  std::size_t stream_size_ = 0;
  GroupVisits visits_;
  bool packets_ = true;
  bool stopped_ = false;
};

}  // namespace gridcast::scene
