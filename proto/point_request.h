#pragma once
// The bodies of points/closest and points/inside.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/math/instance_mask.h"
#include "core/math/point_batch.h"
#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/point_fields.h"
#include "proto/query.h"

namespace gridcast::proto {

/// What is asked about the points; decides which options a body may have.
enum class PointQuestion : std::uint8_t { kClosest, kInside };

/// Points of one request, in world space. Single points may be invalid (NaN or infinite in binary): they get
/// a status each in the answer, the request is fine.
class PointRequest {
 public:
  PointRequest() = default;
  PointRequest(PointRequest&&) = default;
  PointRequest& operator=(PointRequest&&) = default;
  PointRequest(const PointRequest&) = delete;  // batch() may point into `rows`
  PointRequest& operator=(const PointRequest&) = delete;

  double max_distance = std::numeric_limits<double>::infinity();  ///< metres, of points/closest
  std::optional<double> deadline_ms;                              ///< sooner than the server's own
  InstanceMask mask = kFullMask;                                  ///< which instances count
  PointField fields = PointField::kAll;
  std::vector<double> rows;                ///< [N, 3] from JSON; empty when the body is binary
  std::span<const std::byte> binary_body;  ///< the request's own bytes, not copied
  ScalarType scalar = ScalarType::kFloat64;

  /// Valid as long as this object and, for a binary request, the body it was parsed from.
  [[nodiscard]] PointBatch batch() const;
};

/// JSON {"points": [[x,y,z]...], "max_distance"? (points/closest; null is unbounded), "deadline_ms"?,
/// "fields"?: [names of columns], "mask"?} or binary (application/vnd.gridcast.points;
/// dtype=float32|float64), little-endian row-major [N, 3], float32 by default. The query string's
/// max_distance, deadline_ms, fields and mask win. As many points as rays are taken. Problems: those of
/// parse_ray_request, with too_many_points.
[[nodiscard]] Parsed<PointRequest> parse_point_request(std::string_view content_type, std::string_view body,
                                                       const QueryParameters& query, const Limits& limits,
                                                       PointQuestion question);

}  // namespace gridcast::proto
