#pragma once
// Answers of visibility, as JSON columns and as binary columns.

#include <span>
#include <string>

#include "core/math/ray_batch.h"
#include "proto/hit_reply.h"

namespace gridcast::proto {

/// {"scene_version": "7", "status": [0,1,4], "visible": [true,false,null], "t": [null,0.5,null],
///  "instance_id": [null,2,null], ...}: the first blocker, null where there is none.
[[nodiscard]] std::string write_blockers_json(const HitColumns& blockers, const ReplyHead& head);
/// {"scene_version": "7", "status": [0,1,4], "visible": [true,false,null]}
[[nodiscard]] std::string write_visible_json(std::span<const RayStatus> status, const ReplyHead& head);
// In binary the columns are those of write_hits_binary and write_occlusion_binary: status 0 is visible.

}  // namespace gridcast::proto
