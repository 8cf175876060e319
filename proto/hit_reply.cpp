#include "proto/hit_reply.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstring>

#include <nlohmann/json.hpp>

namespace gridcast::proto {
namespace {

/// Grows one string by characters; numbers are written in place, as the shortest text with the same bits.
class JsonText {
 public:
  explicit JsonText(std::size_t expected_bytes) { text_.reserve(expected_bytes); }

  void raw(std::string_view text) { text_.append(text); }
  template <class T>
  void number(T value) {
    constexpr std::size_t kLongest = 32;  // "-2.2250738585072014e-308" has 24
    char buffer[kLongest];
    char* end = std::to_chars(buffer, buffer + kLongest, value).ptr;
    text_.append(buffer, std::size_t(end - buffer));
    // "-0" is an integer to most readers and would lose its sign.
    if (std::is_floating_point_v<T> && value == T(0) && std::signbit(double(value))) text_.append(".0");
  }
  [[nodiscard]] std::string take() && { return std::move(text_); }

 private:
  std::string text_;
};

/// A miss and an invalid ray have no hit to tell of.
bool has_hit(RayStatus status) {
  return status != RayStatus::kMiss && status != RayStatus::kInvalid;
}

/// `,"name":[v,v,null,...]`, each value written by `write(i)`.
template <class Write>
void write_column(JsonText& text, std::string_view name, const std::vector<RayStatus>& status, Write write) {
  text.raw(",\"");
  text.raw(name);
  text.raw("\":[");
  for (std::size_t i = 0; i < status.size(); ++i) {
    if (i != 0) text.raw(",");
    if (has_hit(status[i]))
      write(i);
    else
      text.raw("null");
  }
  text.raw("]");
}

template <class T>
void write_vectors(JsonText& text, std::string_view name, const std::vector<RayStatus>& status,
                   const std::vector<T>& values, std::size_t width) {
  write_column(text, name, status, [&](std::size_t i) {
    for (std::size_t c = 0; c < width; ++c) {
      text.raw(c == 0 ? "[" : ",");
      text.number(values[width * i + c]);
    }
    text.raw("]");
  });
}

template <class T>
void write_scalars(JsonText& text, std::string_view name, const std::vector<RayStatus>& status,
                   const std::vector<T>& values) {
  write_column(text, name, status, [&](std::size_t i) { text.number(values[i]); });
}

/// An infinite bound, which JSON has no number for, is null.
void write_bounds(JsonText& text, std::string_view name, const std::vector<RayStatus>& status,
                  const std::vector<double>& values) {
  write_column(text, name, status, [&](std::size_t i) {
    if (std::isfinite(values[i]))
      text.number(values[i]);
    else
      text.raw("null");
  });
}

/// `{"scene_version":"7","status":[...]`
void write_start(JsonText& text, const ReplyHead& head, std::span<const RayStatus> status) {
  text.raw("{\"scene_version\":\"");
  text.number(head.scene_version);
  text.raw("\",\"status\":[");
  for (std::size_t i = 0; i < status.size(); ++i) {
    if (i != 0) text.raw(",");
    text.number(int(status[i]));
  }
  text.raw("]");
}

nlohmann::ordered_json stats_json(const RayStats& stats) {
  nlohmann::ordered_json json{{"rays", stats.rays},
                              {"hits", stats.hits},
                              {"misses", stats.misses},
                              {"invalid", stats.invalid},
                              {"trace_ms", stats.trace_ms}};
  if (stats.plan) {
    json["order"] = stats.plan->order;
    json["order_reason"] = stats.plan->reason;
    json["order_ms"] = stats.plan->order_ms;
    json["packet_rays"] = stats.plan->packet_rays;
    json["single_rays"] = stats.plan->single_rays;
  }
  return json;
}

void write_end(JsonText& text, const ReplyHead& head) {
  if (head.stats) {
    text.raw(",\"stats\":");
    text.raw(stats_json(*head.stats).dump());
  }
  text.raw("}");
}

constexpr std::size_t kAlignment = 8;
constexpr std::array<std::byte, kAlignment> kZeros{};

/// Collects columns, each starting at a multiple of kAlignment, and describes them for the head.
class ColumnTable {
 public:
  template <class T>
  void add(std::string_view name, std::string_view dtype, std::span<const T> values, std::size_t rows,
           std::size_t width) {
    const auto bytes = std::as_bytes(values);
    const std::size_t gap = (kAlignment - end_ % kAlignment) % kAlignment;
    if (gap != 0) body_.chunks.push_back(std::span(kZeros).first(gap));
    const std::size_t begin = end_ + gap;
    end_ = begin + bytes.size();
    body_.chunks.push_back(bytes);
    auto& entry = head_[std::string(name)];
    entry["dtype"] = dtype;
    entry["shape"] = width == 1 ? nlohmann::ordered_json{rows} : nlohmann::ordered_json{rows, width};
    entry["data_offsets"] = {begin, end_};
  }

  BinaryBody finish(const ReplyHead& head) && {
    auto& metadata = head_["__metadata__"];
    metadata["scene_version"] = std::to_string(head.scene_version);
    if (head.stats) {
      const auto stats = stats_json(*head.stats);
      for (const auto& [name, value] : stats.items())
        metadata[name] = value.is_string() ? value.get<std::string>() : value.dump();
    }
    std::string text = head_.dump();
    text.resize((text.size() + kAlignment - 1) / kAlignment * kAlignment, ' ');
    const std::uint64_t length = text.size();
    body_.head.resize(sizeof length);
    std::memcpy(body_.head.data(), &length, sizeof length);
    body_.head += text;
    return std::move(body_);
  }

 private:
  nlohmann::ordered_json head_ = nlohmann::ordered_json::object();
  BinaryBody body_;
  std::size_t end_ = 0;
};

/// Statuses as the bytes they are on the wire.
std::span<const std::uint8_t> to_bytes(std::span<const RayStatus> status) {
  static_assert(sizeof(RayStatus) == 1);
  return {reinterpret_cast<const std::uint8_t*>(status.data()), status.size()};
}

}  // namespace

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

std::string write_hits_json(const HitColumns& hits, const ReplyHead& head) {
  constexpr std::size_t kBytesPerRay = 128;  // every column of a hit with full digits
  JsonText text(256 + kBytesPerRay * hits.status.size());
  write_start(text, head, hits.status);
  write_scalars(text, "t", hits.status, hits.t);
  if (has(head.fields, HitField::kInstanceId))
    write_scalars(text, "instance_id", hits.status, hits.instance_id);
  if (has(head.fields, HitField::kMeshId)) write_scalars(text, "mesh_id", hits.status, hits.mesh_id);
  if (has(head.fields, HitField::kPrimitiveId))
    write_scalars(text, "primitive_id", hits.status, hits.primitive_id);
  if (has(head.fields, HitField::kUv)) write_vectors(text, "uv", hits.status, hits.uv, 2);
  if (has(head.fields, HitField::kNormal)) write_vectors(text, "normal", hits.status, hits.normal, 3);
  if (has(head.fields, HitField::kTError)) write_bounds(text, "t_error", hits.status, hits.t_error);
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

std::size_t BinaryBody::size_bytes() const {
  std::size_t bytes = head.size();
  for (const auto& chunk : chunks) bytes += chunk.size();
  return bytes;
}

std::string BinaryBody::to_string() const {
  std::string text;
  text.reserve(size_bytes());
  text += head;
  for (const auto& chunk : chunks) text.append(reinterpret_cast<const char*>(chunk.data()), chunk.size());
  return text;
}

BinaryBody write_hits_binary(const HitColumns& hits, const ReplyHead& head) {
  const std::size_t n = hits.status.size();
  ColumnTable table;
  table.add("t", "F64", std::span(hits.t), n, 1);
  if (has(head.fields, HitField::kInstanceId))
    table.add("instance_id", "U32", std::span(hits.instance_id), n, 1);
  if (has(head.fields, HitField::kMeshId)) table.add("mesh_id", "U32", std::span(hits.mesh_id), n, 1);
  if (has(head.fields, HitField::kPrimitiveId))
    table.add("primitive_id", "U32", std::span(hits.primitive_id), n, 1);
  if (has(head.fields, HitField::kUv)) table.add("uv", "F32", std::span(hits.uv), n, 2);
  if (has(head.fields, HitField::kNormal)) table.add("normal", "F32", std::span(hits.normal), n, 3);
  if (has(head.fields, HitField::kTError)) table.add("t_error", "F64", std::span(hits.t_error), n, 1);
  table.add("status", "U8", to_bytes(hits.status), n, 1);
  return std::move(table).finish(head);
}

BinaryBody write_occlusion_binary(std::span<const RayStatus> status, const ReplyHead& head) {
  ColumnTable table;
  table.add("status", "U8", to_bytes(status), status.size(), 1);
  return std::move(table).finish(head);
}

}  // namespace gridcast::proto
