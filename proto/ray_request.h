#pragma once
// The bodies of rays/closest, rays/any, rays/all and rays/count.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/math/hit_lists.h"
#include "core/math/ray_batch.h"
#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/query.h"
#include "proto/ray_options.h"

namespace gridcast::proto {

/// What is asked about the rays; decides which options a body may have.
enum class RayQuestion : std::uint8_t { kClosest, kAny, kAll, kCount };

/// Rays of one request, in world space. Single rays may be invalid (zero direction, NaN, infinite origin in
/// binary): they get a status each in the answer, the request is fine.
class RayRequest {
 public:
  RayRequest() = default;
  RayRequest(RayRequest&&) = default;
  RayRequest& operator=(RayRequest&&) = default;
  RayRequest(const RayRequest&) = delete;  // batch() may point into `rows`
  RayRequest& operator=(const RayRequest&) = delete;

  RayOptions options;
  std::vector<double> rows;                ///< [N, 8] from JSON; empty when the body is binary
  std::vector<PrimitiveRef> excluded;      ///< N or none
  std::vector<HitPosition> after;          ///< N or none; of rays/all
  std::span<const std::byte> binary_body;  ///< the request's own bytes, not copied
  ScalarType scalar = ScalarType::kFloat64;
  std::size_t columns = 8;

  /// Valid as long as this object and, for a binary request, the body it was parsed from.
  [[nodiscard]] RayBatch batch() const;
};

/// `content_type` is the header's value, `body` the bytes. JSON (application/json): columns
///   {"origins": [[x,y,z]...], "directions": [[x,y,z]...], "tnear": [t|null...]?, "tfar": [t|null...]?,
///    "exclude": [[instance_id, primitive_id]|null...]?, "precision"?, "fields"?, "stats"?, "deadline_ms"?,
///    "mask"?}
/// and for rays/all "max_hits"? and "after": [[t, instance_id, primitive_id]|null...]?,
/// where a null tnear is 0 and a null tfar is unbounded. Binary (application/vnd.gridcast.rays;
/// dtype=float32|float64; columns=6|8; exclude=none|ids), little-endian: with ids, uint32 [N, 2] of
/// instance_id and primitive_id, 0xFFFFFFFF in both for none; then row-major [N, columns]; defaults float32,
/// 6 and none. rays/count is decided as by `robust`, so `fast` is a problem (invalid_value). Problems:
/// unsupported_media_type, invalid_json, wrong_length (columns differ in length, bytes are not whole rows),
/// too_many_rays, payload_too_large, and those of the readers.
[[nodiscard]] Parsed<RayRequest> parse_ray_request(std::string_view content_type, std::string_view body,
                                                   const QueryParameters& query, const Limits& limits,
                                                   RayQuestion question = RayQuestion::kClosest);

/// The same of a binary body of rays alone (exclude=none) that is still to come: everything but the rays.
/// Nothing for any other body, and where parse_ray_request would find a problem.
[[nodiscard]] std::optional<RayRequest> announced_rays(std::string_view content_type, std::size_t body_bytes,
                                                       const QueryParameters& query, const Limits& limits,
                                                       RayQuestion question);

}  // namespace gridcast::proto
