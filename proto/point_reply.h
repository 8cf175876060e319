#pragma once
// Answers of points/closest and points/inside, as JSON columns and as binary columns: those that are wanted.

#include <string>

#include "core/math/point_batch.h"
#include "proto/hit_reply.h"
#include "proto/point_fields.h"

namespace gridcast::proto {

/// {"scene_version": "7", "status": [1,0], "distance": [2.5,null], "position": [[1,0,0],null],
///  "instance_id": [2,null], "mesh_id": ..., "primitive_id": ..., "uv": [[0.2,0.5],null]}
[[nodiscard]] std::string write_nearest_json(const NearestColumns& nearest, const ReplyHead& head,
                                             PointField fields = PointField::kAll);
/// distance F64 [N], position F64 [N, 3], ids U32 [N], uv F32 [N, 2], status U8 [N]. Without a surface:
/// distance +Inf, ids 0xFFFFFFFF, the rest 0.
[[nodiscard]] BinaryBody write_nearest_binary(const NearestColumns& nearest, const ReplyHead& head,
                                              PointField fields = PointField::kAll);

/// {"scene_version": "7", "place": [1,0], "splits": [0,1,1], "instance_id": [2], "mesh_id": [0],
///  "winding": [1], "on_boundary": [false], "open_meshes": []}; `place` as PointPlace, rows by splits.
[[nodiscard]] std::string write_inside_json(const InsideColumns& inside, const ReplyHead& head,
                                            PointField fields = PointField::kAll);
/// place U8 [N], splits U64 [N+1]; instance_id, mesh_id U32 [K], winding I32 [K], on_boundary U8 [K];
/// open_meshes U32 [M].
[[nodiscard]] BinaryBody write_inside_binary(const InsideColumns& inside, const ReplyHead& head,
                                             PointField fields = PointField::kAll);

}  // namespace gridcast::proto
