#include "proto/reply_columns.h"

#include <array>
#include <cstring>

namespace gridcast::proto {
namespace {

constexpr std::size_t kAlignment = 8;
constexpr std::array<std::byte, kAlignment> kZeros{};

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

}  // namespace

void JsonText::narrowed(float value) {
  const std::size_t begin = text_.size();
  number(value);
  double read = 0.0;
  std::from_chars(text_.data() + begin, text_.data() + text_.size(), read);
  if (float(read) == value) return;
  text_.resize(begin);
  number(double(value));
}

void write_version(JsonText& text, const ReplyHead& head) {
  text.raw("{\"scene_version\":\"");
  text.number(head.scene_version);
  text.raw("\"");
}

void write_start(JsonText& text, const ReplyHead& head, std::span<const RayStatus> status) {
  write_version(text, head);
  write_list(text, "status", status.size(), [&](std::size_t i) { text.number(int(status[i])); });
}

void write_end(JsonText& text, const ReplyHead& head) {
  if (head.stats) {
    text.raw(",\"stats\":");
    text.raw(stats_json(*head.stats).dump());
  }
  text.raw("}");
}

void ColumnTable::add(std::string_view name, std::string_view dtype, std::span<const std::byte> values,
                      std::size_t rows, std::size_t width) {
  const std::size_t gap = (kAlignment - end_ % kAlignment) % kAlignment;
  if (gap != 0) body_.chunks.push_back(std::span(kZeros).first(gap));
  const std::size_t begin = end_ + gap;
  end_ = begin + values.size();
  body_.chunks.push_back(values);
  auto& entry = head_[std::string(name)];
  entry["dtype"] = dtype;
  entry["shape"] = width == 1 ? nlohmann::ordered_json{rows} : nlohmann::ordered_json{rows, width};
  entry["data_offsets"] = {begin, end_};
}

BinaryBody ColumnTable::finish(const ReplyHead& head) && {
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

}  // namespace gridcast::proto
