#pragma once
// What every question about rays may ask of its answer.

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/math/instance_mask.h"
#include "core/math/ray_batch.h"
#include "proto/json_reader.h"
#include "proto/limits.h"
#include "proto/query.h"

namespace gridcast::proto {

enum class StatsMode : std::uint8_t { kOff, kOn };

/// Given as members of a JSON body or in the query string; the query string wins.
struct RayOptions {
  Precision precision = Precision::kRobust;
  HitField fields = HitField::kAll;
  StatsMode stats = StatsMode::kOff;      ///< adds counts and times to the answer
  std::optional<double> deadline_ms;      ///< sooner than the server's own
  std::optional<std::uint32_t> max_hits;  ///< of a ray, where all hits are listed
  InstanceMask mask = kFullMask;          ///< which instances are seen
};

/// A name of kHitFieldNames; nothing for any other. `status` and `t` are in every answer, so they add nothing
/// to a set.
[[nodiscard]] std::optional<HitField> parse_hit_field(std::string_view name);

/// The members precision, fields, stats, deadline_ms and mask, which are among those that `body` knows.
void read_ray_options(const ObjectReader& body, const Limits& limits, RayOptions& options);
/// The same as parameters.
void apply_ray_options(QueryReader& query, const Limits& limits, RayOptions& options);

}  // namespace gridcast::proto
