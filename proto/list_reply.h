#pragma once
// Answers of rays/all and rays/count, as JSON columns and as binary columns.

#include <string>

#include "core/math/hit_lists.h"
#include "proto/hit_reply.h"

namespace gridcast::proto {

/// {"scene_version": "7", "status": [1,0,3], "splits": [0,2,2,3], "t": [4,5,1], "instance_id": [2,2,0], ...}
/// The hits of ray i are the entries from splits[i] up to, and without, splits[i + 1] of every column but
/// status. A t_error without a bound is null.
[[nodiscard]] std::string write_lists_json(const HitLists& lists, const ReplyHead& head);
/// status U8 [N], splits U64 [N+1], and the columns of write_hits_binary with a row per hit.
[[nodiscard]] BinaryBody write_lists_binary(const HitLists& lists, const ReplyHead& head);

/// {"scene_version": "7", "status": [1,0,4], "count": [4,0,null], "crossings": [2,0,null],
///  "winding": [0,0,null]}: null for an invalid ray.
[[nodiscard]] std::string write_counts_json(const HitCounts& counts, const ReplyHead& head);
/// status U8, count U32, crossings U32, winding I32, all [N]; an invalid ray counts 0.
[[nodiscard]] BinaryBody write_counts_binary(const HitCounts& counts, const ReplyHead& head);

}  // namespace gridcast::proto
