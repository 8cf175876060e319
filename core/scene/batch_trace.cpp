#include "core/scene/batch_trace.h"

#include <algorithm>

#include "core/scene/group_trace.h"
#include "core/scene/trace_one.h"

namespace gridcast::scene {
namespace {

template <Precision kPrecision, bool kAnyHit>
void trace_single(const BatchTarget& target, RayRun& run, std::size_t i) {
  const Ray& ray = run.rays[i];
  const QueryFilter filter{run.excluded.empty() ? PrimitiveRef{} : run.excluded[i], target.mask};
  bool hit = false;
  if constexpr (kAnyHit) {
    hit = any_hit<kPrecision>(target.scene, ray, filter);
  } else {
    closest_hit<kPrecision>(target.scene, ray, filter, run.hits[i]);
    hit = run.hits[i].valid();
  }
  run.status[i] = hit ? RayStatus::kHit : RayStatus::kMiss;
  ++run.single_rays;
}

/// Which groups of a run go together. A stretch of groups begins with a few that do; the others follow them
/// where more rays were in packets than alone at the instances they came to. Otherwise walking together
/// costs some 5 % and brings nothing.
class GroupChoice {
 public:
  explicit GroupChoice(const BatchTarget& target)
      : grouping_(target.is_alone && target.grouping != Grouping::kNever ? Grouping::kAlways
                                                                         : target.grouping) {}

  /// Whether the next group goes together.
  [[nodiscard]] bool together() const {
    return grouping_ == Grouping::kAlways ||
           (grouping_ == Grouping::kWherePacketsForm && (number_ < kFirst || packets_ > alone_));
  }
  /// What a group met; nothing when its rays went alone.
  void add(const GroupVisits& visits) {
    if (number_ < kFirst) {
      packets_ += visits.together;
      alone_ += visits.alone;
    }
    if (++number_ < kStretch) return;
    number_ = 0;
    packets_ = alone_ = 0;
  }

 private:
  static constexpr int kFirst = 4;
  static constexpr int kStretch = 64;

  Grouping grouping_;
  int number_ = 0;  ///< of the group in its stretch
  std::uint64_t packets_ = 0, alone_ = 0;
};

/// More memory than this is not in the caches when a ray comes: the forest at a tenth of its size, 45 MB, is
/// where groups and single rays take the same time.
constexpr std::size_t kInNoCache = std::size_t(64) << 20;
/// The same for rays that were in no order, of which neighbours have less in common.
constexpr std::size_t kInNoCacheSorted = std::size_t(16) << 20;

Grouping choose_grouping(const Scene& scene, RayOrderKind order) {
  const std::size_t bytes =
      scene.top_level().memory_bytes() + scene.instance_slots() * InstanceTable::kBytesPerInstance;
  if (bytes > (order == RayOrderKind::kAsGiven ? kInNoCache : kInNoCacheSorted)) return Grouping::kAlways;
  for (std::uint32_t mesh = 0; mesh < scene.mesh_count(); ++mesh)
    if (scene.blas(mesh).has_packets()) return Grouping::kWherePacketsForm;
  return Grouping::kNever;
}

}  // namespace

BatchTarget::BatchTarget(const Scene& whole, InstanceMask query_mask, RayOrderKind order)
    : scene(whole),
      mask(query_mask),
      grouping(choose_grouping(whole, order)),
      is_alone(whole.top_level().sole_instance().has_value()) {}

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
  GroupTracer<kPrecision, kAnyHit> tracer(target, run, stop);
  GroupChoice choice(target);
  std::uint32_t group[tlas::kGroupSize];
  std::size_t size = 0;
  const auto flush = [&] {
    const std::span<const std::uint32_t> index(group, std::exchange(size, 0));
    if (choice.together()) {
      if (!tracer.trace(index, !target.is_alone || run.packets.packets())) return false;
    } else {
      for (const std::uint32_t i : index) {
        if (stop.stop_requested()) return false;
        trace_single<kPrecision, kAnyHit>(target, run, i);
      }
    }
    const GroupVisits visits = tracer.take_visits();
    choice.add(visits);
    run.packets.add(visits);
    return true;
  };
  for (std::size_t i = 0; i < count; ++i) {
    if constexpr (!kAnyHit) run.hits[i] = Hit{.t = run.rays[i].tfar};
    if (!is_valid(run.rays[i])) {
      run.status[i] = RayStatus::kInvalid;
      continue;
    }
    group[size++] = std::uint32_t(i);
    if (size == tlas::kGroupSize && !flush()) return false;
  }
  return size == 0 || flush();
}

template bool trace_run<Precision::kFast, false>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kFast, true>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kRobust, false>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kRobust, true>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kExact, false>(const BatchTarget&, RayRun&, const std::stop_token&);
template bool trace_run<Precision::kExact, true>(const BatchTarget&, RayRun&, const std::stop_token&);

}  // namespace gridcast::scene
