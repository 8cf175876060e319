// The one file that knows libzstd.

#include "proto/zstd.h"

#include <algorithm>
#include <array>
#include <new>

#include <zstd.h>
#include <zstd_errors.h>

namespace gridcast::proto {
namespace {

// Level 1 packs several hundred MB/s and core; higher levels gain little on columns of numbers.
constexpr int kLevel = 1;
// Between two looks at the stop token: about 2 ms.
constexpr std::size_t kEncodeStep = std::size_t(1) << 20;
constexpr std::size_t kMagicBytes = 4;

Problem broken(std::string detail) {
  return {ProblemCode::kInvalidRequest, std::move(detail), "Content-Encoding"};
}

struct FreeEncoder {
  void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
};

}  // namespace

struct ZstdDecoder::Context {
  Context() : stream(ZSTD_createDCtx()), piece(ZSTD_DStreamOutSize(), '\0') {
    if (stream == nullptr) throw std::bad_alloc();
    ZSTD_DCtx_setParameter(stream, ZSTD_d_windowLogMax, kZstdWindowLog);
  }
  ~Context() { ZSTD_freeDCtx(stream); }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  ZSTD_DCtx* stream;
  std::string piece;  ///< 128 KiB of decoded bytes, on their way
};

ZstdDecoder::ZstdDecoder(std::size_t max_bytes)
    : max_bytes_(max_bytes), room_(max_bytes), context_(std::make_unique<Context>()) {}
ZstdDecoder::~ZstdDecoder() = default;

// The library also reads the formats of before RFC 8878, if built so: their decoders are old and are not for
// strangers. Looking at the magic number keeps them out.
bool ZstdDecoder::continues_magic(char byte) {
  constexpr std::array<unsigned char, kMagicBytes> kFrame{0x28, 0xB5, 0x2F, 0xFD};
  constexpr std::array<unsigned char, kMagicBytes> kSkippable{0x50, 0x2A, 0x4D, 0x18};
  auto value = static_cast<unsigned char>(byte);
  if (magic_bytes_ == 0) {
    skippable_ = (value & 0xF0U) == 0x50U;
    if (skippable_) value = 0x50;
  }
  return value == (skippable_ ? kSkippable : kFrame)[magic_bytes_++];
}

std::optional<Problem> ZstdDecoder::decode(std::string_view encoded, const Take& take) {
  ZSTD_inBuffer in{encoded.data(), encoded.size(), 0};
  bool more_inside = false;
  while (in.pos < encoded.size() || more_inside) {
    in.size = encoded.size();
    if (magic_bytes_ < kMagicBytes) {
      // It goes in alone: of a frame that is whole at hand the library would not look at the window.
      in.size = std::min(in.size, in.pos + kMagicBytes - magic_bytes_);
      for (std::size_t at = in.pos; at < in.size; ++at)
        if (!continues_magic(encoded[at]))
          return broken("the body is not zstd, or goes on after its last frame");
    }
    // One byte more than there is room for, so that crossing the limit is seen.
    ZSTD_outBuffer out{context_->piece.data(), std::min(context_->piece.size(), room_ + 1), 0};
    const std::size_t left = ZSTD_decompressStream(context_->stream, &out, &in);
    if (ZSTD_isError(left) != 0) {
      const bool wide = ZSTD_getErrorCode(left) == ZSTD_error_frameParameter_windowTooLarge;
      return broken(wide ? "a zstd frame needs a window of more than 8 MiB" : "a zstd frame is damaged");
    }
    if (out.pos > room_)
      return Problem{ProblemCode::kPayloadTooLarge,
                     "the decoded body is larger than " + std::to_string(max_bytes_) + " bytes", ""};
    room_ -= out.pos;
    if (out.pos > 0)
      if (auto problem = take({context_->piece.data(), out.pos})) return problem;
    whole_ = left == 0;
    if (whole_) magic_bytes_ = 0;
    more_inside = out.pos == out.size && !whole_;
  }
  return std::nullopt;
}

std::size_t ZstdDecoder::held_bytes() const {
  return ZSTD_sizeof_DCtx(context_->stream) + context_->piece.capacity();
}

std::optional<Problem> ZstdDecoder::finish() const {
  if (whole_) return std::nullopt;
  return broken("the body ends before its zstd frame does");
}

std::optional<std::string> encode_zstd(std::string_view body, const std::stop_token& stop) {
  const std::unique_ptr<ZSTD_CCtx, FreeEncoder> context(ZSTD_createCCtx());
  if (context == nullptr) throw std::bad_alloc();
  ZSTD_CCtx_setParameter(context.get(), ZSTD_c_compressionLevel, kLevel);
  ZSTD_CCtx_setPledgedSrcSize(context.get(), body.size());
  std::string encoded;
  std::string piece(ZSTD_CStreamOutSize(), '\0');
  std::size_t left = 1;
  while (left != 0 || !body.empty()) {
    if (stop.stop_requested()) return std::nullopt;
    ZSTD_inBuffer in{body.data(), std::min(body.size(), kEncodeStep), 0};
    ZSTD_outBuffer out{piece.data(), piece.size(), 0};
    left =
        ZSTD_compressStream2(context.get(), &out, &in, in.size == body.size() ? ZSTD_e_end : ZSTD_e_continue);
    if (ZSTD_isError(left) != 0) throw std::bad_alloc();  // what else can fail here
    encoded.append(piece, 0, out.pos);
    body.remove_prefix(in.pos);
  }
  return encoded;
}

}  // namespace gridcast::proto
