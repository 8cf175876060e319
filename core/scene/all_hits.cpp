#include "core/scene/all_hits.h"

#include <algorithm>
#include <atomic>
#include <new>

#include <tbb/enumerable_thread_specific.h>

#include "core/scene/batch_loop.h"
#include "core/scene/geometric_normal.h"
#include "core/scene/hit_error.h"
#include "core/scene/hit_list.h"
#include "core/scene/trace_one.h"

namespace gridcast::scene {
namespace {

/// Rays whose hits are kept together until their place among all is known.
constexpr std::size_t kRaysPerBlock = 256;

PrimitiveRef excluded_of(const RayBatch& rays, std::size_t i) {
  return i < rays.excluded.size() ? rays.excluded[i] : PrimitiveRef{};
}

template <Precision kPrecision>
void list_hits(const Scene& scene, Ray ray, const QueryFilter& filter, const HitPosition& after,
               HitList& list) {
  // What lies before the position is culled. Not in `fast`, whose t depend on where the range begins.
  if constexpr (kPrecision == Precision::kRobust) ray.tnear = std::max(ray.tnear, after.t);
  mesh::ObjectRay object_ray;
  scene.top_level().traverse(ray, ray.tfar, [&](std::uint32_t id) {
    const Instance instance = scene.instance(id);
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    if (prepare_for(object_ray, instance, blas, ray, list.tfar(), id, filter))
      blas.template intersect_every<kPrecision>(object_ray, list);
    return list.tfar();
  });
}

using BlockHits = std::vector<Hit>;

/// Sets statuses and, in splits[i + 1], the number of hits of ray i. False when ended early.
template <Precision kPrecision>
bool list_all(const Scene& scene, const RayBatch& rays, const AllHitsOptions& options,
              std::vector<BlockHits>& blocks, HitLists& out) {
  std::atomic<std::uint64_t> total = 0;
  tbb::enumerable_thread_specific<HitList> lists;
  return for_each_in_blocks(
      rays.size(), kRaysPerBlock, options.stop, options.progress, [&](std::size_t i, std::size_t block) {
        const Ray ray = rays[i];
        if (!is_valid(ray)) {
          out.status[i] = RayStatus::kInvalid;
          return true;
        }
        const HitPosition after = i < options.after.size() ? options.after[i] : HitPosition{};
        HitList& list = lists.local();
        list.start(ray.tfar, after, options.max_hits);
        list_hits<kPrecision>(scene, ray, {excluded_of(rays, i), options.mask}, after, list);
        out.status[i] = list.finish();
        const std::span<const Hit> hits = list.hits();
        out.splits[i + 1] = hits.size();
        if ((total += hits.size()) > options.max_total_hits) return false;
        blocks[block].insert(blocks[block].end(), hits.begin(), hits.end());
        return true;
      });
}

void fill_columns(const Scene& scene, const RayBatch& rays, HitField fields,
                  const std::vector<BlockHits>& blocks, HitLists& out) {
  for (std::size_t i = 0; i < rays.size(); ++i) out.splits[i + 1] += out.splits[i];
  out.hits.resize(out.splits.back(), fields);
  out.hits.status = {};
  tbb::parallel_for(std::size_t(0), blocks.size(), [&](std::size_t block) {
    const std::size_t first = block * kRaysPerBlock;
    const Hit* from = blocks[block].data();
    for (std::size_t i = first; i < std::min(rays.size(), first + kRaysPerBlock); ++i) {
      for (std::uint64_t row = out.splits[i]; row < out.splits[i + 1]; ++row, ++from) {
        SurfaceHit surface;
        describe(scene, *from, surface);
        if (has(fields, HitField::kNormal)) surface.normal = geometric_normal(scene, *from, rays[i]);
        if (has(fields, HitField::kTError)) surface.t_error = t_error(scene, rays[i], surface);
        out.hits.set(row, surface);
      }
    }
  });
}

}  // namespace

Result<HitLists> intersect_all(const Scene& scene, const RayBatch& rays, const AllHitsOptions& options) try {
  if (options.precision == Precision::kExact)
    return Error{ErrorCode::kUnsupported, "hits are listed in fast and robust precision", "/precision"};
  HitLists out;
  out.status.assign(rays.size(), RayStatus::kMiss);
  out.splits.assign(rays.size() + 1, 0);
  std::vector<BlockHits> blocks((rays.size() + kRaysPerBlock - 1) / kRaysPerBlock);
  const bool whole = options.precision == Precision::kFast
                         ? list_all<Precision::kFast>(scene, rays, options, blocks, out)
                         : list_all<Precision::kRobust>(scene, rays, options, blocks, out);
  if (!whole) {
    if (options.stop.stop_requested()) return Error{ErrorCode::kCancelled, "the trace was cancelled", ""};
    return Error{ErrorCode::kLimitExceeded,
                 "more than " + std::to_string(options.max_total_hits) +
                     " hits in one answer; send fewer rays at a time, or a smaller max_hits",
                 "/max_hits"};
  }
  fill_columns(scene, rays, options.fields, blocks, out);
  return out;
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the answers", ""};
}

}  // namespace gridcast::scene
