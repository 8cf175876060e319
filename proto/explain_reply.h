#pragma once
// The answer of POST .../explain, as JSON; `gridcast explain --json` prints the same.

#include <cstdint>
#include <span>
#include <string>

#include "core/math/hit.h"
#include "core/math/ray_way.h"

namespace gridcast::proto {

struct ExplainReply {
  std::uint64_t scene_version = 0;
  const SurfaceHit& hit;
  const WayCounts& counts;
  std::span<const WayStep> steps;
  bool is_truncated = false;
};

/// {"scene_version": "7", "hit": {"t", "instance_id", "mesh_id", "primitive_id", "uv", "normal"} or null,
///  "truncated": false, "counts": {...}, "steps": [{"kind": "cell", ...}, {"kind": "instance", ...}, ...]}
/// The members of each kind of step are in openapi.yaml. Numbers are the shortest text that reads back to
/// the same bits (uv and normal as float).
[[nodiscard]] std::string write_explain_json(const ExplainReply& reply);

}  // namespace gridcast::proto
