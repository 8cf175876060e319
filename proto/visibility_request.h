#pragma once
// The body of POST .../visibility.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/math/pair_batch.h"
#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/query.h"
#include "proto/ray_options.h"

namespace gridcast::proto {

/// Whether the answer names what is between two points that do not see each other.
enum class BlockerMode : std::uint8_t { kNone, kFirst };

/// Pairs of points of one request, in world space. Single points may be invalid (NaN or infinite in binary):
/// their pair gets a status, the request is fine.
class VisibilityRequest {
 public:
  VisibilityRequest() { options.fields = HitField::kInstanceId | HitField::kPrimitiveId; }
  VisibilityRequest(VisibilityRequest&&) = default;
  VisibilityRequest& operator=(VisibilityRequest&&) = default;
  VisibilityRequest(const VisibilityRequest&) = delete;  // batch() may point into `rows`
  VisibilityRequest& operator=(const VisibilityRequest&) = delete;

  RayOptions options;  ///< fields begin as instance_id and primitive_id
  BlockerMode blocker = BlockerMode::kFirst;
  double margin = 0.0;                     ///< metres
  std::vector<double> rows;                ///< [N, 6] from JSON; empty when the body is binary
  std::vector<PrimitiveRef> excluded;      ///< N or none
  std::vector<PrimitiveRef> targets;       ///< N or none
  std::span<const std::byte> binary_body;  ///< the request's own bytes, not copied
  ScalarType scalar = ScalarType::kFloat64;

  /// Valid as long as this object and, for a binary request, the body it was parsed from.
  [[nodiscard]] PairBatch batch() const;
};

/// JSON {"from": [[x,y,z]...], "to": [[x,y,z]...], "exclude"?, "target"?: [[instance_id,
/// primitive_id]|null...], "margin"?, "blocker"?: true|false, "precision"?, "fields"?, "stats"?,
/// "deadline_ms"?, "mask"?}, or binary (application/vnd.gridcast.pairs; dtype=float32|float64), little-endian
/// row-major [N, 6], float32 by default. All but the columns may come in the query string, which wins. As
/// many pairs as rays are taken. Problems: those of parse_ray_request, with too_many_points.
[[nodiscard]] Parsed<VisibilityRequest> parse_visibility_request(std::string_view content_type,
                                                                 std::string_view body,
                                                                 const QueryParameters& query,
                                                                 const Limits& limits);

}  // namespace gridcast::proto
