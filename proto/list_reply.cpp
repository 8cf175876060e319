#include "proto/list_reply.h"

#include "proto/reply_columns.h"

namespace gridcast::proto {
namespace {

template <class T>
void write_count(JsonText& text, std::string_view name, const std::vector<RayStatus>& status,
                 const std::vector<T>& values) {
  write_list(text, name, status.size(), [&](std::size_t i) {
    if (status[i] == RayStatus::kInvalid) return text.raw("null");
    text.number(values[i]);
  });
}

}  // namespace

std::string write_lists_json(const HitLists& lists, const ReplyHead& head) {
  constexpr std::size_t kBytesPerRay = 12, kBytesPerHit = 128;
  JsonText text(256 + kBytesPerRay * lists.status.size() + kBytesPerHit * lists.hits.t.size());
  write_start(text, head, lists.status);
  write_all(text, "splits", lists.splits);
  write_all(text, "t", lists.hits.t);
  if (has(head.fields, HitField::kInstanceId)) write_all(text, "instance_id", lists.hits.instance_id);
  if (has(head.fields, HitField::kMeshId)) write_all(text, "mesh_id", lists.hits.mesh_id);
  if (has(head.fields, HitField::kPrimitiveId)) write_all(text, "primitive_id", lists.hits.primitive_id);
  if (has(head.fields, HitField::kUv)) write_all(text, "uv", lists.hits.uv, 2);
  if (has(head.fields, HitField::kNormal)) write_all(text, "normal", lists.hits.normal, 3);
  if (has(head.fields, HitField::kTError))
    write_list(text, "t_error", lists.hits.t_error.size(),
               [&](std::size_t i) { write_bound(text, lists.hits.t_error[i]); });
  write_end(text, head);
  return std::move(text).take();
}

BinaryBody write_lists_binary(const HitLists& lists, const ReplyHead& head) {
  ColumnTable table;
  table.add("splits", lists.splits);
  add_hit_columns(table, lists.hits, head.fields);
  table.add("status", lists.status);
  return std::move(table).finish(head);
}

std::string write_counts_json(const HitCounts& counts, const ReplyHead& head) {
  constexpr std::size_t kBytesPerRay = 24;
  JsonText text(256 + kBytesPerRay * counts.status.size());
  write_start(text, head, counts.status);
  write_count(text, "count", counts.status, counts.count);
  write_count(text, "crossings", counts.status, counts.crossings);
  write_count(text, "winding", counts.status, counts.winding);
  write_end(text, head);
  return std::move(text).take();
}

BinaryBody write_counts_binary(const HitCounts& counts, const ReplyHead& head) {
  ColumnTable table;
  table.add("count", counts.count);
  table.add("crossings", counts.crossings);
  table.add("winding", counts.winding);
  table.add("status", counts.status);
  return std::move(table).finish(head);
}

}  // namespace gridcast::proto
