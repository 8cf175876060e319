#include "proto/point_reply.h"

#include "proto/reply_columns.h"

namespace gridcast::proto {

std::string write_nearest_json(const NearestColumns& nearest, const ReplyHead& head, PointField fields) {
  constexpr std::size_t kBytesPerPoint = 160;  // every column with full digits
  JsonText text(256 + kBytesPerPoint * nearest.status.size());
  write_start(text, head, nearest.status);
  write_values(text, "distance", nearest.status, nearest.distance, 1);
  if (wants(fields, PointField::kPosition))
    write_values(text, "position", nearest.status, nearest.position, 3);
  if (wants(fields, PointField::kInstanceId))
    write_values(text, "instance_id", nearest.status, nearest.instance_id, 1);
  if (wants(fields, PointField::kMeshId)) write_values(text, "mesh_id", nearest.status, nearest.mesh_id, 1);
  if (wants(fields, PointField::kPrimitiveId))
    write_values(text, "primitive_id", nearest.status, nearest.primitive_id, 1);
  if (wants(fields, PointField::kUv)) write_values(text, "uv", nearest.status, nearest.uv, 2);
  write_end(text, head);
  return std::move(text).take();
}

BinaryBody write_nearest_binary(const NearestColumns& nearest, const ReplyHead& head, PointField fields) {
  ColumnTable table;
  table.add("distance", nearest.distance);
  if (wants(fields, PointField::kPosition)) table.add("position", nearest.position, 3);
  if (wants(fields, PointField::kInstanceId)) table.add("instance_id", nearest.instance_id);
  if (wants(fields, PointField::kMeshId)) table.add("mesh_id", nearest.mesh_id);
  if (wants(fields, PointField::kPrimitiveId)) table.add("primitive_id", nearest.primitive_id);
  if (wants(fields, PointField::kUv)) table.add("uv", nearest.uv, 2);
  table.add("status", nearest.status);
  return std::move(table).finish(head);
}

std::string write_inside_json(const InsideColumns& inside, const ReplyHead& head, PointField fields) {
  constexpr std::size_t kBytesPerPoint = 48;
  JsonText text(256 + kBytesPerPoint * inside.place.size());
  write_version(text, head);
  write_list(text, "place", inside.place.size(), [&](std::size_t i) { text.number(int(inside.place[i])); });
  if (wants(fields, PointField::kSplits)) write_all(text, "splits", inside.splits);
  if (wants(fields, PointField::kInstanceId)) write_all(text, "instance_id", inside.instance_id);
  if (wants(fields, PointField::kMeshId)) write_all(text, "mesh_id", inside.mesh_id);
  if (wants(fields, PointField::kWinding)) write_all(text, "winding", inside.winding);
  if (wants(fields, PointField::kOnBoundary))
    write_list(text, "on_boundary", inside.on_boundary.size(),
               [&](std::size_t i) { text.raw(inside.on_boundary[i] != 0 ? "true" : "false"); });
  if (wants(fields, PointField::kOpenMeshes)) write_all(text, "open_meshes", inside.open_meshes);
  write_end(text, head);
  return std::move(text).take();
}

BinaryBody write_inside_binary(const InsideColumns& inside, const ReplyHead& head, PointField fields) {
  ColumnTable table;
  if (wants(fields, PointField::kSplits)) table.add("splits", inside.splits);
  if (wants(fields, PointField::kInstanceId)) table.add("instance_id", inside.instance_id);
  if (wants(fields, PointField::kMeshId)) table.add("mesh_id", inside.mesh_id);
  if (wants(fields, PointField::kWinding)) table.add("winding", inside.winding);
  if (wants(fields, PointField::kOpenMeshes)) table.add("open_meshes", inside.open_meshes);
  table.add("place", inside.place);
  if (wants(fields, PointField::kOnBoundary)) table.add("on_boundary", inside.on_boundary);
  return std::move(table).finish(head);
}

}  // namespace gridcast::proto
