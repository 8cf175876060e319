#include "proto/vertex_reply.h"

#include <algorithm>
#include <bit>

#include "proto/reply_columns.h"

namespace gridcast::proto {

std::optional<std::string> write_vertices_json(std::span<const Vec3f> positions, std::size_t max_bytes) {
  constexpr std::size_t kUsualBytesPerVertex = 36, kMostBytesPerVertex = 64;
  JsonText text(std::min(max_bytes, 32 + positions.size() * kUsualBytesPerVertex) + kMostBytesPerVertex);
  const char* before = "{\"positions\":[[";
  for (const Vec3f& position : positions) {
    text.raw(before);
    for (int c = 0; c < 3; ++c) {
      if (c > 0) text.raw(",");
      text.narrowed(position[c]);
    }
    before = "],[";
    if (text.size() > max_bytes) return std::nullopt;
  }
  text.raw(positions.empty() ? "{\"positions\":[]}" : "]]}");
  if (text.size() > max_bytes) return std::nullopt;
  return std::move(text).take();
}

std::string write_vertices_binary(std::span<const Vec3f> positions) {
  static_assert(std::endian::native == std::endian::little && sizeof(Vec3f) == 3 * sizeof(float));
  return {reinterpret_cast<const char*>(positions.data()), positions.size_bytes()};
}

}  // namespace gridcast::proto
