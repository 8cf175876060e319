#include "proto/hit_reply.h"

#include "proto/reply_columns.h"

namespace gridcast::proto {

RayStats& RayStats::operator+=(const RayStats& part) {
  rays += part.rays;
  hits += part.hits;
  misses += part.misses;
  invalid += part.invalid;
  trace_ms += part.trace_ms;
  return *this;
}

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

namespace {

/// One member of all pieces as a column.
template <class Piece, class Values>
void add_column(ColumnTable& table, std::string_view name, std::string_view dtype,
                std::span<const Piece> pieces, Values values, std::size_t width) {
  std::vector<std::span<const std::byte>> bytes;
  std::size_t rows = 0;
  for (const Piece& piece : pieces) {
    const auto& column = values(piece);
    rows += column.size() / width;
    bytes.push_back(std::as_bytes(std::span(column)));
  }
  table.add_pieces(name, dtype, bytes, rows, width);
}

}  // namespace

void add_hit_columns(ColumnTable& table, std::span<const HitColumns> pieces, HitField fields) {
  const auto add = [&](std::string_view name, std::string_view dtype, auto member, std::size_t width = 1) {
    add_column(
        table, name, dtype, pieces, [&](const HitColumns& hits) -> auto& { return hits.*member; }, width);
  };
  add("t", "F64", &HitColumns::t);
  if (has(fields, HitField::kInstanceId)) add("instance_id", "U32", &HitColumns::instance_id);
  if (has(fields, HitField::kMeshId)) add("mesh_id", "U32", &HitColumns::mesh_id);
  if (has(fields, HitField::kPrimitiveId)) add("primitive_id", "U32", &HitColumns::primitive_id);
  if (has(fields, HitField::kUv)) add("uv", "F32", &HitColumns::uv, 2);
  if (has(fields, HitField::kNormal)) add("normal", "F32", &HitColumns::normal, 3);
  if (has(fields, HitField::kTError)) add("t_error", "F64", &HitColumns::t_error);
  add("status", "U8", &HitColumns::status);
}

BinaryBody write_hits_binary(std::span<const HitColumns> pieces, const ReplyHead& head) {
  ColumnTable table;
  add_hit_columns(table, pieces, head.fields);
  return std::move(table).finish(head);
}

BinaryBody write_hits_binary(const HitColumns& hits, const ReplyHead& head) {
  return write_hits_binary(std::span(&hits, 1), head);
}

BinaryBody write_occlusion_binary(std::span<const std::vector<RayStatus>> pieces, const ReplyHead& head) {
  ColumnTable table;
  add_column(
      table, "status", "U8", pieces, [](const auto& status) -> auto& { return status; }, 1);
  return std::move(table).finish(head);
}

BinaryBody write_occlusion_binary(std::span<const RayStatus> status, const ReplyHead& head) {
  ColumnTable table;
  table.add("status", "U8", to_bytes(status), status.size(), 1);
  return std::move(table).finish(head);
}

}  // namespace gridcast::proto
