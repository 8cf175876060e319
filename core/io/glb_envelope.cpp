#include "core/io/glb_envelope.h"

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

namespace gridcast::io {
namespace {

constexpr std::uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr std::uint32_t kBinChunk = 0x004E4942;   // "BIN\0"
constexpr std::size_t kHeaderBytes = 12;
constexpr std::size_t kChunkHeaderBytes = 8;

Error invalid(std::string message, std::string where) {
  return {ErrorCode::kInvalidFile, std::move(message), std::move(where)};
}

std::uint32_t read_u32(std::span<const std::byte> bytes, std::size_t offset) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + offset, 4);
  return value;
}

struct Chunk {
  std::uint32_t type = 0;
  std::span<const std::byte> data;
};

Result<Chunk> read_chunk(std::span<const std::byte> bytes, std::size_t offset) {
  const std::string where = "byte " + std::to_string(offset);
  const std::size_t left = bytes.size() - offset;
  if (left < kChunkHeaderBytes) return invalid("a chunk header is cut off", where);
  const std::size_t length = read_u32(bytes, offset);
  if (length > left - kChunkHeaderBytes) return invalid("a chunk is longer than the file", where);
  return Chunk{read_u32(bytes, offset + 4), bytes.subspan(offset + kChunkHeaderBytes, length)};
}

Result<GlbEnvelope> open_glb(std::span<const std::byte> bytes) {
  if (bytes.size() < kHeaderBytes) return invalid("the GLB header is cut off", "byte 0");
  if (read_u32(bytes, 4) != 2) return invalid("the GLB version is not 2", "byte 4");
  if (read_u32(bytes, 8) != bytes.size())
    return invalid("the length in the GLB header is not the file's length", "byte 8");

  GlbEnvelope envelope;
  int position = 0;
  for (std::size_t offset = kHeaderBytes; offset < bytes.size(); ++position) {
    const auto chunk = read_chunk(bytes, offset);
    if (!chunk) return chunk.error();
    if (position == 0 && chunk->type != kJsonChunk)
      return invalid("the first GLB chunk is not JSON", "byte " + std::to_string(offset));
    if (position == 0) envelope.json = chunk->data;
    if (position == 1 && chunk->type == kBinChunk) envelope.bin = chunk->data;
    offset += kChunkHeaderBytes + chunk->data.size();
  }
  if (position == 0) return invalid("the GLB has no JSON chunk", "byte 12");
  return envelope;
}

/// glTF JSON is one object, which starts after white space at most.
bool starts_like_json(std::span<const std::byte> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string_view::npos && text[first] == '{';
}

}  // namespace

Result<GlbEnvelope> open_envelope(std::span<const std::byte> bytes) {
  if (bytes.size() >= 4 && read_u32(bytes, 0) == kMagic) return open_glb(bytes);
  if (!starts_like_json(bytes))
    return invalid("neither a GLB, which begins with glTF, nor glTF JSON, which begins with {", "byte 0");
  return GlbEnvelope{bytes, std::nullopt};
}

}  // namespace gridcast::io
