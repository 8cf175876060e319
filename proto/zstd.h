#pragma once
// Bodies packed as "Zstandard Compression and the 'application/zstd' Media Type" (RFC 8878, Y. Collet, 2021)
// says, with the window of RFC 9659 (2024). A packed body is one or more frames; skippable frames are
// skipped.

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>

#include "proto/error_table.h"

namespace gridcast::proto {

/// 8 MiB, which every HTTP client and server that knows zstd must do with (RFC 9659): what a frame may make
/// the decoder hold beside what is decoded.
inline constexpr int kZstdWindowLog = 23;

/// Unpacks a body as it comes. Memory follows what has been decoded, never what a frame announces, but for
/// its window.
class ZstdDecoder {
 public:
  /// Of all decoded bytes together.
  explicit ZstdDecoder(std::size_t max_bytes);
  ~ZstdDecoder();
  ZstdDecoder(const ZstdDecoder&) = delete;
  ZstdDecoder& operator=(const ZstdDecoder&) = delete;

  /// Gets decoded bytes, a few at a time; a problem ends the decoding.
  using Take = std::function<std::optional<Problem>(std::string_view)>;
  /// The next encoded bytes. kPayloadTooLarge as soon as more than the limit comes out, kInvalidRequest for
  /// what is no frame; or what `take` says. After a problem the decoder is of no more use.
  [[nodiscard]] std::optional<Problem> decode(std::string_view encoded, const Take& take);
  /// Memory that it holds beside what it has handed on: mostly the window of the largest frame so far.
  [[nodiscard]] std::size_t held_bytes() const;
  /// After the last bytes: kInvalidRequest when a frame is not whole, or there was none.
  [[nodiscard]] std::optional<Problem> finish() const;

 private:
  struct Context;
  [[nodiscard]] bool continues_magic(char byte);

  const std::size_t max_bytes_;
  std::size_t room_;  ///< of max_bytes_, left
  std::unique_ptr<Context> context_;
  std::size_t magic_bytes_ = 0;  ///< of the present frame's magic number, seen
  bool skippable_ = false;       ///< the present frame
  bool whole_ = false;           ///< the last byte ended a frame
};

/// `body` as one frame, at a level that favours speed; nothing when `stop` was requested first.
[[nodiscard]] std::optional<std::string> encode_zstd(std::string_view body, const std::stop_token& stop);

}  // namespace gridcast::proto
