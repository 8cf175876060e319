#include <gtest/gtest.h>

#include "tests/support/gltf_builder.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

TEST(GlbEnvelope, a_document_loads_from_a_glb_and_from_text) {
  const GltfBuilder builder = triangle_document();
  EXPECT_EQ(world_triangles(import_ok(builder.glb())), 1U);
  EXPECT_EQ(world_triangles(import_ok(builder.text())), 1U);
}

TEST(GlbEnvelope, every_cut_of_a_glb_is_refused) {
  const auto whole = triangle_document().glb();
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const std::vector<std::byte> cut(whole.begin(), whole.begin() + std::ptrdiff_t(length));
    EXPECT_FALSE(io::import_gltf(cut).ok()) << "cut at " << length;
  }
}

TEST(GlbEnvelope, what_is_neither_a_glb_nor_json_is_called_that) {
  for (const std::string text : {"", " \n", "glT", "solid cube", "\x89PNG\r\n", "[]", "\xEF\xBB\xBF{}"}) {
    const Error error = import_error(to_bytes(text));
    EXPECT_EQ(error.code, ErrorCode::kInvalidFile);
    EXPECT_EQ(error.where, "byte 0");
    EXPECT_NE(error.message.find("neither a GLB"), std::string::npos) << error.message;
  }
  EXPECT_EQ(import_error(to_bytes(" \r\n\t{\"asset\"")).message.find("neither"), std::string::npos);
}

TEST(GlbEnvelope, a_wrong_version_names_the_byte) {
  auto bytes = triangle_document().glb();
  bytes[4] = std::byte{3};
  EXPECT_EQ(import_error(bytes).where, "byte 4");
}

TEST(GlbEnvelope, a_chunk_length_that_wraps_is_refused) {
  auto bytes = triangle_document().glb();
  for (std::size_t i = 12; i < 16; ++i) bytes[i] = std::byte{0xFF};
  EXPECT_EQ(import_error(bytes).where, "byte 12");
}

TEST(GlbEnvelope, chunks_of_unknown_type_after_the_binary_one_are_ignored) {
  auto bytes = triangle_document().glb();
  const std::uint8_t extra[] = {4, 0, 0, 0, 'X', 'T', 'R', 'A', 1, 2, 3, 4};
  for (const std::uint8_t value : extra) bytes.push_back(std::byte(value));
  bytes[8] = std::byte(bytes.size() & 0xFF);
  bytes[9] = std::byte(bytes.size() >> 8);
  EXPECT_EQ(world_triangles(import_ok(bytes)), 1U);
}

TEST(GlbJson, a_key_that_appears_twice_is_refused_by_name) {
  const auto error = import_error(to_bytes(R"({"asset":{"version":"2.0"},"nodes":[],"nodes":[]})"));
  EXPECT_NE(error.message.find("'nodes'"), std::string::npos) << error.message;
}

TEST(GlbJson, nesting_up_to_the_limit_loads_and_one_more_is_refused) {
  const auto nested = [](int levels) {
    return to_bytes(R"({"asset":{"version":"2.0"},"extras":)" + std::string(std::size_t(levels), '[') +
                    std::string(std::size_t(levels), ']') + "}");
  };
  EXPECT_TRUE(io::import_gltf(nested(63)).ok());
  EXPECT_EQ(import_error(nested(64)).code, ErrorCode::kInvalidFile);
  EXPECT_FALSE(io::import_gltf(nested(5'000'000)).ok());
}

TEST(GlbJson, a_byte_order_mark_is_refused) {
  EXPECT_FALSE(io::import_gltf(to_bytes("\xEF\xBB\xBF{\"asset\":{\"version\":\"2.0\"}}")).ok());
}

TEST(GlbJson, numbers_out_of_range_are_refused) {
  GltfBuilder builder = triangle_document();
  builder.document["nodes"][0]["translation"] = {1e39, 0, 0};
  EXPECT_EQ(import_error(builder.glb()).where, "/nodes/0/translation/0");
}

TEST(GlbJson, limits_are_honoured) {
  io::GltfOptions options;
  options.limits.json_bytes = 10;
  EXPECT_EQ(import_error(triangle_document().glb(), options).code, ErrorCode::kLimitExceeded);
  options = {};
  options.limits.file_bytes = 10;
  EXPECT_EQ(import_error(triangle_document().glb(), options).code, ErrorCode::kLimitExceeded);
  options = {};
  options.limits.decoded_bytes = 10;
  EXPECT_EQ(import_error(triangle_document().glb(), options).code, ErrorCode::kLimitExceeded);
}

}  // namespace
}  // namespace gridcast::test
