#include "core/scene/trace.h"

#include <array>
#include <atomic>
#include <new>

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include "core/scene/batch_trace.h"
#include "core/scene/geometric_normal.h"
#include "core/scene/hit_error.h"
#include "core/scene/hit_prefetch.h"
#include "core/scene/ray_order.h"
#include "core/scene/trace_one.h"
#include "core/scene/traced_rows.h"

namespace gridcast::scene {
namespace {

/// Rays per task.
constexpr std::size_t kRaysPerTask = 2048;

template <Precision kPrecision>
SurfaceHit intersect_one(const Scene& scene, const Ray& ray, const QueryFilter& filter) {
  SurfaceHit surface;
  if (!is_valid(ray)) {
    surface.status = RayStatus::kInvalid;
    return surface;
  }
  Hit best{.t = ray.tfar};
  closest_hit<kPrecision>(scene, ray, filter, best);
  if (!best.valid()) return surface;
  surface.status = RayStatus::kHit;
  describe(scene, best, surface);
  surface.normal = geometric_normal(scene, best, ray);
  return surface;
}

template <Precision kPrecision>
RayStatus occluded_one(const Scene& scene, const Ray& ray, const QueryFilter& filter) {
  if (!is_valid(ray)) return RayStatus::kInvalid;
  return any_hit<kPrecision>(scene, ray, filter) ? RayStatus::kHit : RayStatus::kMiss;
}

/// Traces a batch in an order, run by run over all cores, and hands each run to `keep(run, begin)`, where ray
/// i of the run is at place begin + i in that order. `stats` has the order. False when stopped.
template <Precision kPrecision, bool kAnyHit, class Keep>
bool trace_batch(const Scene& scene, const RayBatch& rays, const RayOrder& order, const TraceOptions& options,
                 TraceStats stats, const Keep& keep) {
  const BatchTarget target(scene, options.mask, order.kind);
  if (target.grouping == Grouping::kAlways) stats.reason += "; in groups, as the top level is large";
  const std::size_t count = rays.size();
  std::atomic<std::size_t> done = 0;
  tbb::enumerable_thread_specific<RayRun> runs;
  const auto piece = [&](const tbb::blocked_range<std::size_t>& range) {
    if (options.stop.stop_requested()) return;
    RayRun& run = runs.local();
    run.load(rays, order.permutation, range.begin(), range.end());
    if (!trace_run<kPrecision, kAnyHit>(target, run, options.stop)) return;
    keep(run, range.begin());
    const std::size_t now = done += range.size();
    if (options.progress) options.progress(double(now) / double(count));
  };
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kRaysPerTask), piece,
                    tbb::simple_partitioner());
  for (const RayRun& run : runs) {
    stats.packet_rays += run.packet_rays;
    stats.single_rays += run.single_rays;
  }
  if (options.stats != nullptr) *options.stats = std::move(stats);
  return done == count;
}

Error cancelled() {
  return {ErrorCode::kCancelled, "the trace was cancelled", ""};
}

Error out_of_memory() {
  return {ErrorCode::kLimitExceeded, "not enough memory for the answers", ""};
}

/// Makes the normals of hits as they come, eight at a time, and writes them into their rows.
template <class Rows>
class NormalWriter {
 public:
  NormalWriter(const Scene& scene, Rows& rows) : batch_(scene), rows_(rows) {}

  void add(const Hit& hit, const Ray& ray, std::size_t place) {
    batch_.set(size_, hit, ray);
    places_[size_++] = place;
    if (size_ == NormalBatch::kSize) flush();
  }
  void flush() {
    batch_.make();
    for (std::size_t lane = 0; lane < size_; ++lane) rows_.set_normal(places_[lane], batch_.normal(lane));
    size_ = 0;
  }

 private:
  NormalBatch batch_;
  Rows& rows_;
  std::array<std::size_t, NormalBatch::kSize> places_{};
  std::size_t size_ = 0;
};

/// A function of its own, so that the answer it looks at is no other's: one that is looked at has to be in
/// memory, where it is written number by number and read by twos, which waits for the writes.
double error_of(const Scene& scene, const Hit& hit, const Ray& ray) {
  SurfaceHit surface;
  describe(scene, hit, surface);
  return t_error(scene, ray, surface);
}

/// The answers of a run into its rows, from `begin` on. `Rows` is HitColumns or TracedRows.
template <class Rows>
void keep_run(const Scene& scene, const RayRun& run, HitField fields, std::size_t begin, Rows& rows) {
  const HitPrefetch prefetch(scene, run);
  NormalWriter<Rows> normals(scene, rows);
  for (std::size_t i = 0; i < run.rays.size(); ++i) {
    prefetch.before(i);
    SurfaceHit surface;
    surface.status = run.status[i];
    if (surface.status == RayStatus::kHit) {
      describe(scene, run.hits[i], surface);
      if (has(fields, HitField::kTError)) surface.t_error = error_of(scene, run.hits[i], run.rays[i]);
    }
    rows.set(begin + i, surface);
    if (surface.status == RayStatus::kHit && has(fields, HitField::kNormal))
      normals.add(run.hits[i], run.rays[i], begin + i);
  }
  normals.flush();
}

template <Precision kPrecision>
bool intersect_all(const Scene& scene, const RayBatch& rays, const TraceOptions& options, HitColumns& hits,
                   std::size_t first) {
  TraceStats stats;
  const RayOrder order = choose_order(scene, rays, stats);
  const auto trace_into = [&](auto& rows, std::size_t row) {
    return trace_batch<kPrecision, false>(scene, rays, order, options, stats,
                                          [&](const RayRun& run, std::size_t begin) {
                                            keep_run(scene, run, options.fields, row + begin, rows);
                                          });
  };
  if (order.permutation.empty()) return trace_into(hits, first);
  TracedRows rows(rays.size());
  if (!trace_into(rows, 0)) return false;
  rows.put_into(hits, first, order.places);
  return true;
}

template <Precision kPrecision>
bool occluded_all(const Scene& scene, const RayBatch& rays, const TraceOptions& options,
                  std::span<RayStatus> status) {
  TraceStats stats;
  const RayOrder order = choose_order(scene, rays, stats);
  const auto keep = [&](const RayRun& run, std::size_t begin) {
    for (std::size_t i = 0; i < run.rays.size(); ++i)
      status[order.permutation.empty() ? begin + i : order.permutation[begin + i]] = run.status[i];
  };
  return trace_batch<kPrecision, true>(scene, rays, order, options, stats, keep);
}

}  // namespace

SurfaceHit intersect(const Scene& scene, const Ray& ray, Precision precision, PrimitiveRef excluded,
                     InstanceMask mask) {
  const QueryFilter filter{excluded, mask};
  return for_precision(precision,
                       [&]<Precision kPrecision>() { return intersect_one<kPrecision>(scene, ray, filter); });
}

RayStatus occluded(const Scene& scene, const Ray& ray, Precision precision, PrimitiveRef excluded,
                   InstanceMask mask) {
  const QueryFilter filter{excluded, mask};
  return for_precision(precision,
                       [&]<Precision kPrecision>() { return occluded_one<kPrecision>(scene, ray, filter); });
}

Status intersect_into(const Scene& scene, const RayBatch& rays, const TraceOptions& options, HitColumns& hits,
                      std::size_t first) try {
  const bool whole = for_precision(options.precision, [&]<Precision kPrecision>() {
    return intersect_all<kPrecision>(scene, rays, options, hits, first);
  });
  return whole ? ok_status() : Status(cancelled());
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

Status occluded_into(const Scene& scene, const RayBatch& rays, const TraceOptions& options,
                     std::span<RayStatus> status) try {
  const bool whole = for_precision(options.precision, [&]<Precision kPrecision>() {
    return occluded_all<kPrecision>(scene, rays, options, status);
  });
  return whole ? ok_status() : Status(cancelled());
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

Result<HitColumns> intersect(const Scene& scene, const RayBatch& rays, const TraceOptions& options) try {
  HitColumns hits;
  hits.make_room(rays.size(), options.fields);
  if (Status traced = intersect_into(scene, rays, options, hits, 0); !traced) return traced.error();
  return hits;
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

Result<std::vector<RayStatus>> occluded(const Scene& scene, const RayBatch& rays,
                                        const TraceOptions& options) try {
  std::vector<RayStatus> status(rays.size(), RayStatus::kMiss);
  if (Status traced = occluded_into(scene, rays, options, status); !traced) return traced.error();
  return status;
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

}  // namespace gridcast::scene
