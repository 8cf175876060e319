#include <gtest/gtest.h>

#include "tests/support/gltf_builder.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

using Positions = std::vector<Vec3f>;

/// Positions of the only mesh, whose primitive is `accessor`.
Positions positions_of(GltfBuilder builder, int accessor) {
  builder.add_node({{"mesh", builder.add_mesh({{"attributes", {{"POSITION", accessor}}}})}});
  const auto scene = import_ok(builder.glb());
  return scene.meshes.empty() ? Positions{} : scene.meshes[0]->positions;
}

TEST(GltfAccessors, quantised_positions_of_every_integer_type_are_read) {
  const auto check = [](auto zero, bool normalized, float scale) {
    using T = decltype(zero);
    GltfBuilder builder;
    builder.document["extensionsRequired"] = {"KHR_mesh_quantization"};
    // A vertex of small integers fills 4 or 8 bytes: the stride is a multiple of four.
    const std::vector<T> padded = {T(0), T(0), T(0), T(0), T(100), T(0), T(0), T(0), T(0), T(50), T(7), T(0)};
    const int view = builder.add_view(std::as_bytes(std::span(padded)), int(4 * sizeof(T)));
    const int accessor = builder.describe_accessor("VEC3", component_type<T>(), 3, view, normalized);
    const Positions expected = {{0, 0, 0}, {100 / scale, 0, 0}, {0, 50 / scale, 7 / scale}};
    EXPECT_EQ(positions_of(builder, accessor), expected) << component_type<T>();
  };
  check(std::int8_t(0), false, 1.F);
  check(std::uint8_t(0), false, 1.F);
  check(std::int16_t(0), false, 1.F);
  check(std::uint16_t(0), false, 1.F);
  check(std::int8_t(0), true, 127.F);
  check(std::uint8_t(0), true, 255.F);
  check(std::int16_t(0), true, 32767.F);
  check(std::uint16_t(0), true, 65535.F);
}

TEST(GltfAccessors, the_most_negative_normalised_value_becomes_minus_one) {
  GltfBuilder builder;
  const std::vector<std::int8_t> bytes = {-128, -127, 0, 0, 127, 0, 0, 0, 0, 127, 0, 0};
  const int view = builder.add_view(std::as_bytes(std::span(bytes)), 4);
  const auto positions = positions_of(builder, builder.describe_accessor("VEC3", 5120, 3, view, true));
  ASSERT_EQ(positions.size(), 3U);
  EXPECT_EQ(positions[0], Vec3f(-1, -1, 0));
}

TEST(GltfAccessors, interleaved_positions_and_normals_are_told_apart) {
  GltfBuilder builder;
  const std::vector<float> data = {0, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 3, 0, 1, 0, 0, 0, 4};
  const int view = builder.add_view(std::as_bytes(std::span(data)), 24);
  const int positions = builder.describe_accessor("VEC3", 5126, 3, view);
  const int normals = builder.describe_accessor("VEC3", 5126, 3, view);
  builder.document["accessors"][std::size_t(normals)]["byteOffset"] = 12;
  builder.add_node(
      {{"mesh", builder.add_mesh({{"attributes", {{"POSITION", positions}, {"NORMAL", normals}}}})}});
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.meshes.size(), 1U);
  EXPECT_EQ(scene.meshes[0]->positions, (Positions{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}));
  EXPECT_EQ(scene.meshes[0]->normals, Positions(3, Vec3f(0, 0, 1)));
}

TEST(GltfAccessors, a_normal_without_direction_is_taken_from_the_faces) {
  GltfBuilder builder = triangle_document();
  const int normals = builder.add_accessor<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  builder.document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = normals;
  const auto scene = import_ok(builder.glb());
  EXPECT_EQ(scene.meshes.at(0)->normals, (Positions{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}));
}

TEST(GltfAccessors, sparse_values_replace_those_of_the_view_or_zeros) {
  for (const bool with_view : {true, false}) {
    GltfBuilder builder;
    const int accessor = with_view ? builder.add_accessor<float>("VEC3", {0, 0, 0, 1, 0, 0, 5, 5, 5})
                                   : builder.describe_accessor("VEC3", 5126, 3, -1);
    const std::vector<std::uint8_t> indices = {2};
    const std::vector<float> values = {0, 1, 0};
    const int index_view = builder.add_view(std::as_bytes(std::span(indices)));
    const int value_view = builder.add_view(std::as_bytes(std::span(values)));
    builder.document["accessors"][std::size_t(accessor)]["sparse"] = {
        {"count", 1},
        {"indices", {{"bufferView", index_view}, {"componentType", 5121}}},
        {"values", {{"bufferView", value_view}}}};
    const Vec3f second = with_view ? Vec3f(1, 0, 0) : Vec3f(0);
    EXPECT_EQ(positions_of(builder, accessor), (Positions{{0, 0, 0}, second, {0, 1, 0}}));
  }
}

TEST(GltfAccessors, a_sparse_index_past_the_end_is_refused) {
  GltfBuilder builder;
  const int accessor = builder.describe_accessor("VEC3", 5126, 3, -1);
  const std::vector<std::uint16_t> indices = {3};
  const std::vector<float> values = {0, 1, 0};
  builder.document["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices",
       {{"bufferView", builder.add_view(std::as_bytes(std::span(indices)))}, {"componentType", 5123}}},
      {"values", {{"bufferView", builder.add_view(std::as_bytes(std::span(values)))}}}};
  builder.add_mesh({{"attributes", {{"POSITION", accessor}}}});
  EXPECT_EQ(import_error(builder.glb()).where, "/accessors/0/sparse/indices");
}

TEST(GltfAccessors, an_accessor_without_a_view_is_all_zeros_also_as_indices) {
  GltfBuilder builder = triangle_document();
  builder.document["meshes"][0]["primitives"][0]["indices"] =
      builder.describe_accessor("SCALAR", 5123, 3, -1);
  const auto scene = import_ok(builder.glb());
  EXPECT_EQ(scene.meshes.at(0)->triangles, (std::vector<mesh::Triangle>{{0, 0, 0}}));
}

TEST(GltfAccessors, indices_of_every_type_are_read) {
  const auto check = [](auto zero) {
    using T = decltype(zero);
    GltfBuilder builder = triangle_document();
    builder.document["meshes"][0]["primitives"][0]["indices"] =
        builder.add_accessor<T>("SCALAR", {T(2), T(1), T(0), T(0), T(1), T(2)});
    const auto scene = import_ok(builder.glb());
    EXPECT_EQ(scene.meshes.at(0)->triangles, (std::vector<mesh::Triangle>{{2, 1, 0}, {0, 1, 2}}));
  };
  check(std::uint8_t(0));
  check(std::uint16_t(0));
  check(std::uint32_t(0));
}

TEST(GltfAccessors, positions_that_are_not_finite_or_huge_are_refused_by_accessor_and_element) {
  for (const float bad : {std::nanf(""), INFINITY, -INFINITY, 1.1e18F}) {
    GltfBuilder builder;
    const int accessor = builder.add_accessor<float>("VEC3", {0, 0, 0, 1, bad, 0, 0, 1, 0});
    builder.add_mesh({{"attributes", {{"POSITION", accessor}}}});
    const Error error = import_error(builder.glb());
    EXPECT_EQ(error.where, "/accessors/0");
    EXPECT_NE(error.message.find("element 1"), std::string::npos) << error.message;
  }
}

TEST(GltfAccessors, sizes_that_wrap_or_pass_their_container_are_refused) {
  const auto refused_at = [](const char* pointer, const nlohmann::json& value) {
    GltfBuilder builder = triangle_document();
    builder.document["buffers"] = {{{"byteLength", builder.bin.size()}}};
    builder.document[nlohmann::json::json_pointer(pointer)] = value;
    return import_error(builder.glb()).where;
  };
  EXPECT_EQ(refused_at("/bufferViews/0/byteLength", 37), "/bufferViews/0");
  EXPECT_EQ(refused_at("/bufferViews/0/byteOffset", 0xFFFFFFFFFFFFFFFFULL), "/bufferViews/0/byteOffset");
  EXPECT_EQ(refused_at("/bufferViews/0/byteOffset", 0xFFFFFFFCU), "/bufferViews/0");
  EXPECT_EQ(refused_at("/bufferViews/0/byteStride", 8), "/accessors/0");
  EXPECT_EQ(refused_at("/bufferViews/0/byteStride", 16), "/accessors/0");
  EXPECT_EQ(refused_at("/bufferViews/0/byteStride", 6), "/bufferViews/0/byteStride");
  EXPECT_EQ(refused_at("/accessors/0/count", 0x55555556U), "/accessors/0");
  EXPECT_EQ(refused_at("/accessors/0/count", 0), "/accessors/0/count");
  EXPECT_EQ(refused_at("/accessors/0/count", -1), "/accessors/0/count");
  EXPECT_EQ(refused_at("/accessors/0/count", 2.5), "/accessors/0/count");
  EXPECT_EQ(refused_at("/accessors/0/byteOffset", 4), "/accessors/0");
  EXPECT_EQ(refused_at("/accessors/0/componentType", 5124), "/accessors/0");
  EXPECT_EQ(refused_at("/accessors/0/bufferView", 1), "/accessors/0/bufferView");
  EXPECT_EQ(refused_at("/buffers/0/byteLength", 1ULL << 39), "/buffers/0");
  EXPECT_EQ(refused_at("/meshes/0/primitives/0/attributes/POSITION", 4294967296ULL),
            "/meshes/0/primitives/0/attributes/POSITION");
}

TEST(GltfAccessors, zeros_from_a_small_file_are_bounded) {
  GltfBuilder builder;
  const int accessor = builder.describe_accessor("VEC3", 5126, 60'000'000, -1);
  builder.add_mesh({{"attributes", {{"POSITION", accessor}}}});
  EXPECT_EQ(import_error(builder.glb()).code, ErrorCode::kLimitExceeded);
}

}  // namespace
}  // namespace gridcast::test
