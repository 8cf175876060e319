#include "core/scene/made_rays.h"

#include <algorithm>
#include <new>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace gridcast::scene {
namespace {

constexpr std::size_t kColumns = 8;
/// Rays of a piece: 16 MiB of rows, enough for all cores and for sorting.
constexpr std::size_t kRaysPerPiece = std::size_t(1) << 18;

void make_rows(const MadeRays& rays, std::size_t begin, std::vector<double>& rows) {
  constexpr std::size_t kRaysPerTask = 4096;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rows.size() / kColumns, kRaysPerTask),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i < range.end(); ++i) {
                        const Ray ray = rays.ray(begin + i);
                        double* row = rows.data() + kColumns * i;
                        for (int c = 0; c < 3; ++c) {
                          row[c] = ray.origin[c];
                          row[4 + c] = ray.direction[c];
                        }
                        row[3] = ray.tnear;
                        row[7] = ray.tfar;
                      }
                    });
}

void add(const TraceStats& piece, TraceStats& sum) {
  sum.order = piece.order;
  sum.reason = piece.reason;
  sum.packet_rays += piece.packet_rays;
  sum.single_rays += piece.single_rays;
  sum.order_ms += piece.order_ms;
}

/// The part of the whole work that one piece is.
ProgressCallback progress_of(const ProgressCallback& whole, std::size_t begin, std::size_t rays,
                             std::size_t all) {
  if (!whole) return {};
  return [&whole, begin, rays, all](double fraction) {
    whole((double(begin) + fraction * double(rays)) / double(all));
  };
}

/// Hands every piece to `trace(batch, first ray)`, until one of them fails.
template <class Trace>
Status for_each_piece(const MadeRays& rays, const Trace& trace) {
  std::vector<double> rows;
  for (std::size_t begin = 0; begin < rays.count; begin += kRaysPerPiece) {
    const std::size_t count = std::min(kRaysPerPiece, rays.count - begin);
    rows.resize(count * kColumns);
    make_rows(rays, begin, rows);
    const auto excluded = rays.excluded.empty() ? rays.excluded : rays.excluded.subspan(begin, count);
    Status traced =
        trace(RayBatch{std::as_bytes(std::span(rows)), ScalarType::kFloat64, kColumns, excluded}, begin);
    if (!traced) return traced;
  }
  return ok_status();
}

/// Hands every piece to `trace(batch, first ray, options of the piece)`.
template <class Trace>
Status trace_pieces(const MadeRays& rays, const TraceOptions& options, const Trace& trace) {
  TraceStats sum, piece;
  Status traced = for_each_piece(rays, [&](const RayBatch& batch, std::size_t begin) -> Status {
    TraceOptions of_piece = options;
    of_piece.progress = progress_of(options.progress, begin, batch.size(), rays.count);
    of_piece.stats = &piece;
    Status done = trace(batch, begin, of_piece);
    if (done) add(piece, sum);
    return done;
  });
  if (options.stats != nullptr) *options.stats = std::move(sum);
  return traced;
}

template <class T, class Allocator>
void append(const std::vector<T, Allocator>& part, std::vector<T, Allocator>& whole) {
  whole.insert(whole.end(), part.begin(), part.end());
}

void append(const HitLists& part, HitLists& whole) {
  const std::uint64_t before = whole.splits.back();
  append(part.status, whole.status);
  for (std::size_t i = 1; i < part.splits.size(); ++i) whole.splits.push_back(before + part.splits[i]);
  append(part.hits.t, whole.hits.t);
  append(part.hits.uv, whole.hits.uv);
  append(part.hits.normal, whole.hits.normal);
  append(part.hits.instance_id, whole.hits.instance_id);
  append(part.hits.mesh_id, whole.hits.mesh_id);
  append(part.hits.primitive_id, whole.hits.primitive_id);
  append(part.hits.t_error, whole.hits.t_error);
}

Error out_of_memory() {
  return {ErrorCode::kLimitExceeded, "not enough memory for the answers", ""};
}

}  // namespace

Result<HitColumns> intersect(const Scene& scene, const MadeRays& rays, const TraceOptions& options) try {
  HitColumns hits;
  hits.make_room(rays.count, options.fields);
  const Status traced =
      trace_pieces(rays, options, [&](const RayBatch& batch, std::size_t begin, const TraceOptions& piece) {
        return intersect_into(scene, batch, piece, hits, begin);
      });
  if (!traced) return traced.error();
  return hits;
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

Result<std::vector<RayStatus>> occluded(const Scene& scene, const MadeRays& rays,
                                        const TraceOptions& options) try {
  std::vector<RayStatus> status(rays.count, RayStatus::kMiss);
  const Status traced =
      trace_pieces(rays, options, [&](const RayBatch& batch, std::size_t begin, const TraceOptions& piece) {
        return occluded_into(scene, batch, piece, std::span(status).subspan(begin, batch.size()));
      });
  if (!traced) return traced.error();
  return status;
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

Result<HitLists> intersect_all(const Scene& scene, const MadeRays& rays, const AllHitsOptions& options) try {
  HitLists lists;
  lists.splits.push_back(0);
  const Status traced = for_each_piece(rays, [&](const RayBatch& batch, std::size_t begin) -> Status {
    AllHitsOptions of_piece = options;
    of_piece.after = {};
    of_piece.max_total_hits = options.max_total_hits - lists.splits.back();
    of_piece.progress = progress_of(options.progress, begin, batch.size(), rays.count);
    const auto part = intersect_all(scene, batch, of_piece);
    if (!part) return part.error();
    append(*part, lists);
    return ok_status();
  });
  if (!traced) return traced.error();
  return lists;
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

}  // namespace gridcast::scene
