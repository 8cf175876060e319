#include "proto/hit_reply.h"

#include "proto/reply_columns.h"

namespace gridcast::proto {

RayStats count_statuses(std::span<const RayStatus> status, double trace_ms) {
  RayStats stats;
  stats.rays = status.size();
  stats.trace_ms = trace_ms;
  for (const RayStatus s : status) {
    if (s == RayStatus::kInvalid)
      ++stats.invalid;
    else if (s == RayStatus::kMiss)
      ++stats.misses;
    else
      ++stats.hits;
  }
  return stats;
}

void write_hit_columns(JsonText& text, const HitColumns& hits, HitField fields) {
  write_values(text, "t", hits.status, hits.t, 1);
  if (has(fields, HitField::kInstanceId)) write_values(text, "instance_id", hits.status, hits.instance_id, 1);
  if (has(fields, HitField::kMeshId)) write_values(text, "mesh_id", hits.status, hits.mesh_id, 1);
  if (has(fields, HitField::kPrimitiveId))
    write_values(text, "primitive_id", hits.status, hits.primitive_id, 1);
  if (has(fields, HitField::kUv)) write_values(text, "uv", hits.status, hits.uv, 2);
  if (has(fields, HitField::kNormal)) write_values(text, "normal", hits.status, hits.normal, 3);
  if (has(fields, HitField::kTError))
    write_column(text, "t_error", hits.status, [&](std::size_t i) { write_bound(text, hits.t_error[i]); });
}

std::string write_hits_json(const HitColumns& hits, const ReplyHead& head) {
  constexpr std::size_t kBytesPerRay = 128;  // every column of a hit with full digits
  JsonText text(256 + kBytesPerRay * hits.status.size());
  write_start(text, head, hits.status);
  write_hit_columns(text, hits, head.fields);
  write_end(text, head);
  return std::move(text).take();
}

std::string write_occlusion_json(std::span<const RayStatus> status, const ReplyHead& head) {
  constexpr std::size_t kBytesPerRay = 8;
  JsonText text(256 + kBytesPerRay * status.size());
  write_start(text, head, status);
  text.raw(",\"occluded\":[");
  for (std::size_t i = 0; i < status.size(); ++i) {
    if (i != 0) text.raw(",");
    text.raw(status[i] == RayStatus::kInvalid ? "null" : has_hit(status[i]) ? "true" : "false");
  }
  text.raw("]");
  write_end(text, head);
  return std::move(text).take();
}

void add_hit_columns(ColumnTable& table, const HitColumns& hits, HitField fields) {
  table.add("t", hits.t);
  if (has(fields, HitField::kInstanceId)) table.add("instance_id", hits.instance_id);
  if (has(fields, HitField::kMeshId)) table.add("mesh_id", hits.mesh_id);
  if (has(fields, HitField::kPrimitiveId)) table.add("primitive_id", hits.primitive_id);
  if (has(fields, HitField::kUv)) table.add("uv", hits.uv, 2);
  if (has(fields, HitField::kNormal)) table.add("normal", hits.normal, 3);
  if (has(fields, HitField::kTError)) table.add("t_error", hits.t_error);
}

BinaryBody write_hits_binary(const HitColumns& hits, const ReplyHead& head) {
  ColumnTable table;
  add_hit_columns(table, hits, head.fields);
  table.add("status", hits.status);
  return std::move(table).finish(head);
}

BinaryBody write_occlusion_binary(std::span<const RayStatus> status, const ReplyHead& head) {
  ColumnTable table;
  table.add("status", status);
  return std::move(table).finish(head);
}

}  // namespace gridcast::proto
