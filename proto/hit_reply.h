#pragma once
// Answers of rays/closest and rays/any, as JSON columns and as binary columns.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/math/ray_batch.h"

namespace gridcast::proto {

/// How the engine traced a batch; no answer depends on it.
struct RayPlan {
  std::string order;            ///< as_given, by_origin, by_direction
  std::string reason;           ///< why this order
  std::size_t packet_rays = 0;  ///< up to sixteen at a time
  std::size_t single_rays = 0;  ///< the others, one by one
  double order_ms = 0.0;        ///< looking and sorting
};

/// Sent when the request says `stats`.
struct RayStats {
  std::size_t rays = 0;
  std::size_t hits = 0;
  std::size_t misses = 0;
  std::size_t invalid = 0;
  double trace_ms = 0.0;
  std::optional<RayPlan> plan;
};
[[nodiscard]] RayStats count_statuses(std::span<const RayStatus> status, double trace_ms);

struct ReplyHead {
  std::uint64_t scene_version = 0;
  HitField fields = HitField::kAll;  ///< the columns that `HitColumns` was resized with
  std::optional<RayStats> stats;
};

/// {"scene_version": "7", "status": [1,0], "t": [4,null], "instance_id": [2,null], "mesh_id": ...,
///  "primitive_id": ..., "uv": [[0.2,0.5],null], "normal": [[0,0,1],null], "stats"?: {...}}
/// A ray without a hit is null in every column but status, and so is a t_error without a bound. Numbers are
/// the shortest text that reads back to the same bits (t as double, uv and normal as float).
[[nodiscard]] std::string write_hits_json(const HitColumns& hits, const ReplyHead& head);

/// {"scene_version": "7", "status": [1,0,4], "occluded": [true,false,null], "stats"?: {...}}
[[nodiscard]] std::string write_occlusion_json(std::span<const RayStatus> status, const ReplyHead& head);

/// A body in pieces that need no copy: `head`, then the chunks, which point into the columns.
///
/// Layout (safetensors' head): u64 little-endian n; n bytes of JSON {"__metadata__": {"scene_version": "7",
/// ...}, NAME: {"dtype": "F64|F32|U32|U8", "shape": [...], "data_offsets": [begin, end]}}, padded with spaces
/// to a multiple of 8; then the columns. Offsets count from the end of the head; each column starts at a
/// multiple of 8, so there may be up to 7 zero bytes between two (safetensors proper has none).
struct BinaryBody {
  std::string head;
  std::vector<std::span<const std::byte>> chunks;

  [[nodiscard]] std::size_t size_bytes() const;
  [[nodiscard]] std::string to_string() const;
};

/// A miss is t = t_error = +Inf, ids 0xFFFFFFFF, uv and normal 0. Valid as long as `hits` is.
[[nodiscard]] BinaryBody write_hits_binary(const HitColumns& hits, const ReplyHead& head);
/// One column `status` (U8).
[[nodiscard]] BinaryBody write_occlusion_binary(std::span<const RayStatus> status, const ReplyHead& head);

}  // namespace gridcast::proto
