// Media types, Accept, content codings, Prefer and entity tags.

#include <array>

#include <gtest/gtest.h>

#include "proto/content_coding.h"
#include "proto/etag.h"
#include "proto/media_type.h"
#include "proto/prefer.h"

namespace gridcast::proto {
namespace {

TEST(MediaType, parameters_are_read_with_and_without_quotes) {
  const auto type = parse_media_type(" Model/GLTF-Binary ; A=b; c=\"d \\\"e\" ");
  ASSERT_TRUE(type);
  EXPECT_EQ(type->essence, "model/gltf-binary");
  EXPECT_EQ(*type->find("a"), "b");
  EXPECT_EQ(*type->find("c"), "d \"e");
  EXPECT_EQ(type->find("e"), nullptr);
}

TEST(MediaType, what_breaks_the_grammar_is_none) {
  for (const std::string text :
       {"", "/", "a/", "/b", "a", "a/b c", "a/b;", "a/b;c", "a/b;c=", "a/b;c=\"d", "a/b,c/d", "a/b;c=d;c=d"})
    EXPECT_FALSE(parse_media_type(text)) << text;
}

TEST(Prefer, known_preferences_are_found_among_others) {
  EXPECT_FALSE(parse_prefer("").respond_async);
  EXPECT_TRUE(parse_prefer("respond-async").respond_async);
  EXPECT_TRUE(parse_prefer(" foo; bar, Respond-Async ; x=y").respond_async);
  EXPECT_EQ(parse_prefer("respond-async, wait=10").wait_s, 10.0);
  EXPECT_EQ(parse_prefer("wait = \"3\", wait=5").wait_s, 3.0);
  EXPECT_EQ(parse_prefer("wait=4294967295").wait_s, 86'400.0);
}

TEST(Prefer, what_breaks_the_grammar_is_ignored) {
  for (const char* text :
       {",", ";", "=", "wait", "wait=", "wait=x", "wait=-1", "wait=1x", "wait=99999999999", "wait=\""}) {
    EXPECT_FALSE(parse_prefer(text).wait_s) << text;
    EXPECT_FALSE(parse_prefer(text).respond_async) << text;
  }
  EXPECT_FALSE(parse_prefer("respond-asynchronously").respond_async);
}

TEST(Accept, the_client_chooses_among_what_is_offered) {
  constexpr std::array<std::string_view, 2> kOffered{kPngMediaType, kExrMediaType};
  EXPECT_EQ(negotiate("", kOffered), 0U);
  EXPECT_EQ(negotiate("*/*", kOffered), 0U);
  EXPECT_EQ(negotiate("image/x-exr", kOffered), 1U);
  EXPECT_EQ(negotiate("image/*", kOffered), 0U);
  EXPECT_EQ(negotiate("image/png;q=0.5, image/x-exr", kOffered), 1U);
  EXPECT_EQ(negotiate("image/*;q=0.9, image/png;q=0.1", kOffered), 1U);
  EXPECT_EQ(negotiate("*/*, image/png;q=0", kOffered), 1U);
  EXPECT_EQ(negotiate("text/html", kOffered), std::nullopt);
  EXPECT_EQ(negotiate("image/png;q=0", kOffered), std::nullopt);
  EXPECT_EQ(negotiate("!!!", kOffered), std::nullopt);
}

TEST(ContentEncoding, zstd_is_taken_once_and_nothing_else) {
  for (const char* header : {"", " ", "identity", "Identity"})
    EXPECT_EQ(parse_content_encoding(header), BodyCoding::kIdentity) << header;
  for (const char* header : {"zstd", " ZSTD\t", "zStd"})
    EXPECT_EQ(parse_content_encoding(header), BodyCoding::kZstd) << header;
  for (const char* header : {"gzip", "x-zstd", "zstd, zstd", "identity, zstd", "zstd, identity", "zstd,", ",",
                             "zstd;q=1", "zst", "zstdd", "*"})
    EXPECT_EQ(parse_content_encoding(header), std::nullopt) << header;
}

TEST(AcceptEncoding, the_client_chooses_how_an_answer_leaves) {
  const auto expect = [](AnswerCoding coding, std::initializer_list<const char*> headers) {
    for (const char* header : headers) EXPECT_EQ(int(choose_answer_coding(header)), int(coding)) << header;
  };
  expect(AnswerCoding::kIdentity, {"", "identity", "gzip, br", "zstd;q=0", "zstd;q=0.000", "*;q=1, zstd;q=0",
                                   "gzip, deflate", "zstd;q=0.4, identity;q=0.5", "zstd;q=0.999, identity"});
  expect(AnswerCoding::kZstd,
         {"zstd", "ZSTD", "gzip, zstd", " gzip ,\tzstd ; q=0.1 ", "*", "*;q=0.5", "zstd;q=0.001",
          "identity;q=0.5, zstd;Q=0.5", "identity;q=0.4, zstd;q=0.5", "zstd, *;q=0.1", ",zstd,,"});
  expect(AnswerCoding::kZstdOnly,
         {"zstd, identity;q=0", "zstd, *;q=0", "*, identity;q=0", "zstd;q=0.1, *;q=0.0"});
  expect(AnswerCoding::kNone,
         {"identity;q=0", "*;q=0", "gzip, identity;q=0", "zstd;q=0, identity;q=0", "gzip, *;q=0"});
}

TEST(AcceptEncoding, what_breaks_the_grammar_is_ignored_whole) {
  for (const char* header : {"zstd;", "zstd;q", "zstd;q=", "zstd;q=2", "zstd;q=1.001", "zstd;q=0.1234",
                             "zstd;q=-1", "zstd;q=0x1", "zstd;q=nan", "zstd;q=.5", "zstd;level=3", "zstd q=1",
                             "\"zstd\"", ";q=1", "zstd, identity;q=x", "zstd;q=1;q=0"})
    EXPECT_EQ(int(choose_answer_coding(header)), int(AnswerCoding::kIdentity)) << header;
}

TEST(EntityTag, the_tag_of_a_packed_answer_names_the_same_version) {
  EXPECT_EQ(packed_etag(etag(7)), "\"7-zstd\"");
  for (const TagComparison comparison : {TagComparison::kStrong, TagComparison::kWeak}) {
    EXPECT_EQ(match_etag("\"7-zstd\"", 7, comparison), TagMatch::kMatches);
    EXPECT_EQ(match_etag("\"6-zstd\", \"7-zstd\"", 7, comparison), TagMatch::kMatches);
    for (const char* other :
         {"\"6-zstd\"", "\"-zstd\"", "\"7-zstd-zstd\"", "\"7-gzip\"", "\"7-ZSTD\"", "\"7zstd\""})
      EXPECT_EQ(match_etag(other, 7, comparison), TagMatch::kDiffers) << other;
  }
  EXPECT_EQ(match_etag("W/\"7-zstd\"", 7, TagComparison::kStrong), TagMatch::kDiffers);
  EXPECT_TRUE(has_packed_etag("\"1\", \"7-zstd\""));
  EXPECT_FALSE(has_packed_etag("\"7\""));
}

TEST(EntityTag, strong_and_weak_comparison) {
  EXPECT_EQ(etag(7), "\"7\"");
  const auto strong = [](std::string_view header) { return match_etag(header, 7, TagComparison::kStrong); };
  EXPECT_EQ(strong("\"7\""), TagMatch::kMatches);
  EXPECT_EQ(strong("*"), TagMatch::kMatches);
  EXPECT_EQ(strong(" \"6\" , \"7\" "), TagMatch::kMatches);
  EXPECT_EQ(strong("\"6\""), TagMatch::kDiffers);
  EXPECT_EQ(strong("\"07\""), TagMatch::kDiffers);
  EXPECT_EQ(strong("W/\"7\""), TagMatch::kDiffers);
  EXPECT_EQ(match_etag("W/\"7\"", 7, TagComparison::kWeak), TagMatch::kMatches);
  for (const std::string_view broken : {"", "7", "\"7", "\"7\",", "\"7\" \"8\"", "\"7\"x", "**"})
    EXPECT_EQ(strong(broken), TagMatch::kMalformed) << broken;
}

}  // namespace
}  // namespace gridcast::proto
