// Media types, Accept, Prefer and entity tags.

#include <array>

#include <gtest/gtest.h>

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
