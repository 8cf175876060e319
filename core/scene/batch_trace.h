#pragma once
// A run of rays of a batch: packets where neighbours are close, single rays where not.

#include <cstddef>
#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "core/blas/ray_packet.h"
#include "core/math/hit.h"
#include "core/math/ray_batch.h"
#include "core/scene/packet_choice.h"
#include "core/scene/scene.h"
#include "core/scene/trace_stats.h"

namespace gridcast::scene {

/// Which rays of a batch go in groups of sixteen (core/scene/group_trace.h). kNever: each by itself.
/// kWherePacketsForm: while a packet forms wherever the first groups of a stretch come to an instance.
/// kAlways: the top level is so large that rays wait for memory, which a group does side by side.
enum class Grouping : std::uint8_t { kNever, kWherePacketsForm, kAlways };

/// What is the same for all rays of a batch.
struct BatchTarget {
  BatchTarget(const Scene& whole, InstanceMask query_mask, RayOrderKind order = RayOrderKind::kAsGiven);

  const Scene& scene;
  InstanceMask mask;
  Grouping grouping = Grouping::kNever;
  /// There is but one instance: no top level is needed then, and packets go straight to its tree.
  bool is_alone = false;
};

/// A run of rays and their answers, reused from run to run of a task.
struct RayRun {
  std::vector<Ray> rays;
  std::vector<PrimitiveRef> excluded;
  std::vector<RayStatus> status;
  std::vector<Hit> hits;          ///< closest only
  std::uint64_t packet_rays = 0;  ///< were in the packet of an instance at least
  std::uint64_t single_rays = 0;
  PacketChoice packets;  ///< what the runs before were like

  /// Rays [begin, end) of the batch, or of its permutation where that is not empty.
  void load(const RayBatch& batch, std::span<const std::uint32_t> permutation, std::size_t begin,
            std::size_t end);
};

/// Sets `status`, and for the closest hit `hits`, of every ray of the run. False when stopped on the way: the
/// token is looked at before every packet and every ray alone, since one from far away can take a tenth of a
/// second.
template <Precision kPrecision, bool kAnyHit>
bool trace_run(const BatchTarget& target, RayRun& run, const std::stop_token& stop);

}  // namespace gridcast::scene
