#pragma once
// The body of POST .../explain.

#include <cstddef>
#include <optional>
#include <string_view>

#include "core/math/instance_mask.h"
#include "core/math/ray.h"
#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/query.h"

namespace gridcast::proto {

/// What `max_steps` is when not given, or the limit where that is less.
inline constexpr std::size_t kDefaultExplainSteps = 10'000;

/// One ray in world space, valid as is_valid() says.
struct ExplainRequest {
  Ray ray;
  PrimitiveRef excluded;
  Precision precision = Precision::kRobust;
  std::size_t max_steps = kDefaultExplainSteps;
  InstanceMask mask = kFullMask;      ///< which instances the ray sees
  std::optional<double> deadline_ms;  ///< sooner than the server's own
};

/// JSON {"origin": [x,y,z], "direction": [x,y,z], "tnear"?: t|null, "tfar"?: t|null, "exclude"?:
/// [instance_id, primitive_id]|null, "precision"?, "max_steps"?, "mask"?, "deadline_ms"?}, where a null tnear
/// is 0 and a null tfar is unbounded. precision, max_steps, mask and deadline_ms may come in the query
/// string, which wins. Problems: those of the readers; out_of_range for a ray that is not valid.
[[nodiscard]] Parsed<ExplainRequest> parse_explain_request(std::string_view body,
                                                           const QueryParameters& query,
                                                           const Limits& limits);

}  // namespace gridcast::proto
