// Bodies packed with zstd: whole, cut, damaged, and made to hurt.

#include "proto/zstd.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace gridcast::proto {
namespace {

const std::string kMagic("\x28\xB5\x2F\xFD", 4);
constexpr std::size_t kBlock = std::size_t(128) << 10;

struct Decoded {
  std::string outcome = "ok";  ///< or the code
  std::string body;
};

/// Everything through a decoder, `step` bytes at a time.
Decoded decode(std::string_view encoded, std::size_t max_bytes = std::size_t(64) << 20,
               std::size_t step = 65'536) {
  Decoded decoded;
  ZstdDecoder decoder(max_bytes);
  const auto take = [&](std::string_view part) {
    decoded.body.append(part);
    return std::optional<Problem>();
  };
  std::optional<Problem> problem;
  while (!problem && !encoded.empty()) {
    problem = decoder.decode(encoded.substr(0, step), take);
    encoded.remove_prefix(std::min(step, encoded.size()));
  }
  if (!problem) problem = decoder.finish();
  if (problem) decoded.outcome = describe(problem->code).name;
  return decoded;
}

std::string encode(std::string_view body) {
  return encode_zstd(body, std::stop_token()).value();
}

/// Text that shrinks, or bytes that do not.
std::string sample(std::size_t bytes, int kinds) {
  std::mt19937 random(7);
  std::string text(bytes, ' ');
  for (char& c : text) c = char(int(random() % unsigned(kinds)));
  return text;
}

/// A block header of RFC 8878, 3.1.1.2: kind 0 raw, 1 one byte repeated.
std::string block_header(unsigned kind, std::size_t size, bool last) {
  const std::size_t value = size << 3U | kind << 1U | (last ? 1U : 0U);
  return {char(value & 0xFFU), char(value >> 8U & 0xFFU), char(value >> 16U & 0xFFU)};
}
/// Window_Descriptor: 2^`log` bytes.
char window(int log) {
  return char((log - 10) << 3);
}
/// A frame of four bytes for every 128 KiB of zeros.
std::string bomb(std::size_t blocks, int window_log = 20) {
  std::string frame = kMagic + '\0' + window(window_log);
  for (std::size_t i = 0; i < blocks; ++i) frame += block_header(1, kBlock, i + 1 == blocks) + '\0';
  return frame;
}

TEST(Zstd, what_was_packed_comes_back_in_pieces_of_any_size) {
  for (const int kinds : {1, 8, 256})
    for (const std::size_t bytes :
         {std::size_t(0), std::size_t(1), std::size_t(1000), std::size_t(3'000'001)}) {
      const std::string body = sample(bytes, kinds);
      const std::string packed = encode(body);
      for (const std::size_t step :
           {std::size_t(1), std::size_t(3), std::size_t(65'536), packed.size() + 1}) {
        if (step < 4 && packed.size() > 100'000) continue;
        const Decoded decoded = decode(packed, bytes, step);
        EXPECT_EQ(decoded.outcome, "ok") << bytes << " bytes of " << kinds << " kinds by " << step;
        EXPECT_TRUE(decoded.body == body) << bytes << " bytes of " << kinds << " kinds by " << step;
      }
    }
}

TEST(Zstd, text_gets_smaller) {
  EXPECT_LT(encode(sample(1 << 20, 8)).size(), std::size_t(1) << 19);
}

TEST(Zstd, the_limit_is_of_what_comes_out_and_is_seen_as_it_is_crossed) {
  const std::string packed = encode(sample(300'000, 8));
  EXPECT_EQ(decode(packed, 300'000).outcome, "ok");
  EXPECT_EQ(decode(packed, 299'999).outcome, "payload_too_large");
  EXPECT_EQ(decode(packed, 0).outcome, "payload_too_large");
  const std::string gigabyte = bomb(8192);
  EXPECT_LT(gigabyte.size(), 33'000U);
  const Decoded stopped = decode(gigabyte, 1'000'000);
  EXPECT_EQ(stopped.outcome, "payload_too_large");
  EXPECT_LE(stopped.body.size(), 1'000'000U);
}

TEST(Zstd, the_limit_holds_for_all_frames_together) {
  const std::string packed = encode(std::string(1000, 'a'));
  EXPECT_EQ(decode(packed + packed, 2000).outcome, "ok");
  EXPECT_EQ(decode(packed + packed, 1999).outcome, "payload_too_large");
}

TEST(Zstd, frames_follow_each_other_and_skippable_ones_are_skipped) {
  const std::string skipped("\x5E\x2A\x4D\x18\x03\x00\x00\x00xyz", 11);
  for (const std::size_t step : {1U, 2U, 5U, 1000U}) {
    const Decoded decoded = decode(encode("one") + skipped + encode("") + encode("two") + skipped, 6, step);
    EXPECT_EQ(decoded.outcome, "ok") << step;
    EXPECT_EQ(decoded.body, "onetwo") << step;
  }
}

TEST(Zstd, a_cut_body_is_refused_at_every_length) {
  const std::string packed = encode(sample(2000, 8));
  for (std::size_t length = 0; length < packed.size(); ++length)
    EXPECT_EQ(decode(packed.substr(0, length)).outcome, "invalid_request") << length;
}

TEST(Zstd, bytes_behind_the_last_frame_are_refused) {
  for (const std::string& more :
       {std::string("x"), std::string("\x28"), kMagic, std::string(100, '\0'), kMagic + "?"})
    for (const std::size_t step : {1U, 1000U})
      EXPECT_EQ(decode(encode("body") + more, 1000, step).outcome, "invalid_request") << more;
}

TEST(Zstd, what_is_something_else_is_refused) {
  const std::string legacy = "\x25\xB5\x2F\xFD";  // version 0.5, which the library may still know
  for (const std::string& body : {std::string("{}"), std::string("\x1F\x8B\x08\x00", 4),
                                  legacy + std::string(40, '\0'), std::string("\x50\x2A\x4D\x19\0\0\0\0", 8)})
    EXPECT_EQ(decode(body).outcome, "invalid_request") << body;
}

TEST(Zstd, windows_end_at_8_mib) {
  EXPECT_EQ(decode(bomb(1, 23)).outcome, "ok");
  EXPECT_EQ(decode(bomb(1, 24)).outcome, "invalid_request");
  EXPECT_EQ(decode(bomb(1, 41)).outcome, "invalid_request");
  // Nor is it forgotten where a short frame with its size in it (256 and 2 bytes of 0) is at hand whole.
  const std::string sized =
      std::string("\x40") + window(24) + std::string(2, '\0') + block_header(1, 256, true) + 'a';
  for (const std::size_t step : {1U, 5U, 1000U})
    EXPECT_EQ(decode(kMagic + sized, 1000, step).outcome, "invalid_request") << step;
}

TEST(Zstd, a_size_that_a_frame_only_announces_is_not_believed) {
  // Frame_Content_Size of 8 bytes: 2^60.
  const std::string size("\0\0\0\0\0\0\0\x10", 8);
  const std::string one_byte = block_header(0, 1, true) + "a";
  EXPECT_EQ(decode(kMagic + "\xC0" + window(20) + size + one_byte).outcome, "invalid_request");
  EXPECT_EQ(decode(kMagic + "\xE0" + size + one_byte).outcome, "invalid_request") << "the size is the window";
}

TEST(Zstd, a_wrong_checksum_is_refused) {
  // Single segment, checksum, one byte of size.
  const std::string frame = kMagic + "\x24\x01" + block_header(0, 1, true) + "a";
  EXPECT_EQ(decode(frame + std::string(4, '\0')).outcome, "invalid_request");
}

TEST(Zstd, damaged_bytes_are_refused_or_come_out_within_the_limit) {
  const std::string packed = encode(sample(2000, 8));
  for (std::size_t bit = 0; bit < packed.size() * 8; ++bit) {
    std::string damaged = packed;
    damaged[bit / 8] = char(damaged[bit / 8] ^ (1 << bit % 8));
    const Decoded decoded = decode(damaged, 4000);
    EXPECT_TRUE(decoded.outcome == "ok" || decoded.outcome == "invalid_request" ||
                decoded.outcome == "payload_too_large");
    EXPECT_LE(decoded.body.size(), 4000U);
  }
}

TEST(Zstd, who_takes_the_bytes_can_end_it) {
  ZstdDecoder decoder(kBlock * 10);
  std::size_t calls = 0;
  const auto take = [&](std::string_view) -> std::optional<Problem> {
    ++calls;
    return Problem{ProblemCode::kMemoryFull, "enough", ""};
  };
  const auto problem = decoder.decode(bomb(10), take);
  ASSERT_TRUE(problem);
  EXPECT_EQ(problem->code, ProblemCode::kMemoryFull);
  EXPECT_EQ(calls, 1U);
}

TEST(Zstd, packing_stops_when_it_is_told_to) {
  std::stop_source source;
  source.request_stop();
  EXPECT_FALSE(encode_zstd("body", source.get_token()));
}

TEST(Zstd, what_a_decoder_holds_follows_the_windows_of_the_frames) {
  const auto held = [](int log) {
    ZstdDecoder decoder(std::size_t(64) << 20);
    // A frame of unknown size with a window, one byte repeated.
    const std::string frame = kMagic + std::string(1, 0) + window(log) + block_header(1, 1024, false) + "x";
    EXPECT_FALSE(decoder.decode(frame, [](std::string_view) { return std::optional<Problem>(); }));
    return decoder.held_bytes();
  };
  EXPECT_LT(held(10), std::size_t(1) << 20);
  EXPECT_GE(held(kZstdWindowLog), std::size_t(1) << kZstdWindowLog);
  EXPECT_LT(held(kZstdWindowLog), (std::size_t(1) << kZstdWindowLog) + (std::size_t(1) << 20));
}

}  // namespace
}  // namespace gridcast::proto
