#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include "tests/support/gltf_builder.h"
#include "tests/support/shapes.h"
#include "tests/unit/io/import_helpers.h"

namespace gridcast::test {
namespace {

using Bytes = std::vector<std::byte>;

Bytes encode_vertices(const void* data, std::size_t count, std::size_t stride) {
  Bytes packed(meshopt_encodeVertexBufferBound(count, stride));
  packed.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(packed.data()), packed.size(),
                                           data, count, stride));
  return packed;
}

Bytes encode_indices(const std::vector<std::uint32_t>& indices, std::size_t vertices) {
  Bytes packed(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  packed.resize(meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(packed.data()), packed.size(),
                                          indices.data(), indices.size()));
  return packed;
}

/// Adds compressed bytes and a view that stands for their decoded form in a fallback buffer without bytes.
int add_packed_view(GltfBuilder& builder, const char* extension, const Bytes& packed,
                    nlohmann::json description) {
  const int source = builder.add_view(packed);
  nlohmann::json& views = builder.document["bufferViews"];
  description["buffer"] = 0;
  description["byteOffset"] = views[std::size_t(source)]["byteOffset"];
  description["byteLength"] = packed.size();
  const std::size_t bytes =
      description["count"].get<std::size_t>() * description["byteStride"].get<std::size_t>();
  nlohmann::json view = {{"buffer", 1}, {"byteOffset", 0}, {"byteLength", bytes}};
  if (description["mode"] == "ATTRIBUTES") view["byteStride"] = description["byteStride"];
  view["extensions"][extension] = std::move(description);
  views.push_back(std::move(view));
  return int(views.size()) - 1;
}

void add_fallback_buffer(GltfBuilder& builder) {
  builder.document["buffers"] = {{{"byteLength", builder.bin.size()}}, {{"byteLength", 1 << 20}}};
}

/// An icosphere with compressed positions and indices.
GltfBuilder packed_sphere(const char* extension, const TriangleMesh& sphere) {
  GltfBuilder builder;
  builder.document["extensionsRequired"] = {extension};
  std::vector<std::uint32_t> indices;
  for (const auto& triangle : sphere.triangles)
    indices.insert(indices.end(), triangle.begin(), triangle.end());
  const std::size_t n = sphere.positions.size();
  const int vertex_view = add_packed_view(builder, extension, encode_vertices(sphere.positions.data(), n, 12),
                                          {{"count", n}, {"byteStride", 12}, {"mode", "ATTRIBUTES"}});
  const int index_view =
      add_packed_view(builder, extension, encode_indices(indices, n),
                      {{"count", indices.size()}, {"byteStride", 4}, {"mode", "TRIANGLES"}});
  const int positions = builder.describe_accessor("VEC3", 5126, n, vertex_view);
  const int corners = builder.describe_accessor("SCALAR", 5125, indices.size(), index_view);
  builder.add_node(
      {{"mesh", builder.add_mesh({{"attributes", {{"POSITION", positions}}}, {"indices", corners}})}});
  add_fallback_buffer(builder);
  return builder;
}

TEST(GltfMeshopt, both_extensions_decode_to_the_exact_positions_and_the_same_triangles) {
  const TriangleMesh sphere = icosphere(2);
  for (const char* extension : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    const auto scene = import_ok(packed_sphere(extension, sphere).glb());
    ASSERT_EQ(scene.meshes.size(), 1U);
    EXPECT_EQ(scene.meshes[0]->positions, sphere.positions);
    ASSERT_EQ(scene.meshes[0]->triangle_count(), sphere.triangle_count());
    for (std::size_t i = 0; i < sphere.triangle_count(); ++i) {
      // The index codec may rotate a triangle, which keeps its winding.
      auto triangle = scene.meshes[0]->triangles[i];
      for (int turn = 0; turn < 3 && triangle != sphere.triangles[i]; ++turn)
        std::rotate(triangle.begin(), triangle.begin() + 1, triangle.end());
      EXPECT_EQ(triangle, sphere.triangles[i]);
    }
  }
}

TEST(GltfMeshopt, index_sequences_keep_their_order) {
  const std::vector<std::uint32_t> order = {2, 1, 0, 0, 2, 1};
  Bytes packed(meshopt_encodeIndexSequenceBound(order.size(), 3));
  packed.resize(meshopt_encodeIndexSequence(reinterpret_cast<unsigned char*>(packed.data()), packed.size(),
                                            order.data(), order.size()));
  GltfBuilder builder = triangle_document();
  const int view = add_packed_view(builder, "EXT_meshopt_compression", packed,
                                   {{"count", 6}, {"byteStride", 2}, {"mode", "INDICES"}});
  builder.document["meshes"][0]["primitives"][0]["indices"] =
      builder.describe_accessor("SCALAR", 5123, 6, view);
  add_fallback_buffer(builder);
  const auto scene = import_ok(builder.glb());
  EXPECT_EQ(scene.meshes.at(0)->triangles, (std::vector<mesh::Triangle>{{2, 1, 0}, {0, 2, 1}}));
}

TEST(GltfMeshopt, the_octahedral_filter_gives_unit_normals) {
  const std::vector<float> normals = {0, 0, 1, 0, 1, 0, 0, 0, 0.6F, 0, -0.8F, 0};
  std::vector<std::int8_t> filtered(12);
  meshopt_encodeFilterOct(filtered.data(), 3, 4, 8, normals.data());
  GltfBuilder builder = triangle_document();
  const int view =
      add_packed_view(builder, "EXT_meshopt_compression", encode_vertices(filtered.data(), 3, 4),
                      {{"count", 3}, {"byteStride", 4}, {"mode", "ATTRIBUTES"}, {"filter", "OCTAHEDRAL"}});
  builder.document["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
      builder.describe_accessor("VEC3", 5120, 3, view, true);
  add_fallback_buffer(builder);
  const auto scene = import_ok(builder.glb());
  ASSERT_EQ(scene.meshes.at(0)->normals.size(), 3U);
  EXPECT_LT(max_abs(scene.meshes[0]->normals[0] - Vec3f(0, 0, 1)), 0.02F);
  EXPECT_LT(max_abs(scene.meshes[0]->normals[2] - Vec3f(0.6F, 0, -0.8F)), 0.02F);
}

TEST(GltfMeshopt, the_exponential_filter_gives_the_positions_back) {
  const std::vector<float> positions = {0, 0, 0, 1.5F, 0, 0, 0, -2.25F, 0};
  std::vector<std::uint32_t> filtered(9);
  meshopt_encodeFilterExp(filtered.data(), 3, 12, 24, positions.data());
  GltfBuilder builder;
  const int view =
      add_packed_view(builder, "KHR_meshopt_compression", encode_vertices(filtered.data(), 3, 12),
                      {{"count", 3}, {"byteStride", 12}, {"mode", "ATTRIBUTES"}, {"filter", "EXPONENTIAL"}});
  builder.add_mesh({{"attributes", {{"POSITION", builder.describe_accessor("VEC3", 5126, 3, view)}}}});
  add_fallback_buffer(builder);
  const auto scene = import_ok(builder.glb());
  EXPECT_EQ(scene.meshes.at(0)->positions, (std::vector<Vec3f>{{0, 0, 0}, {1.5F, 0, 0}, {0, -2.25F, 0}}));
}

TEST(GltfMeshopt, damaged_data_and_wrong_sizes_are_refused) {
  const GltfBuilder good = packed_sphere("EXT_meshopt_compression", icosphere(1));
  GltfBuilder bad = good;
  bad.bin[0] = std::byte{0x11};
  EXPECT_EQ(import_error(bad.glb()).where, "/bufferViews/1");
  const auto refused = [&](const char* pointer, const nlohmann::json& value) {
    GltfBuilder edited = good;
    edited.document["bufferViews"][1]["extensions"]["EXT_meshopt_compression"]
                   [nlohmann::json::json_pointer(pointer)] = value;
    return !io::import_gltf(edited.glb()).ok();
  };
  EXPECT_TRUE(refused("/count", 1 << 30));
  EXPECT_TRUE(refused("/byteStride", 16));
  EXPECT_TRUE(refused("/byteLength", 10));
  EXPECT_TRUE(refused("/byteOffset", 1 << 20));
  EXPECT_TRUE(refused("/mode", "TRIANGLES"));
  EXPECT_TRUE(refused("/mode", "SOMETHING"));
  EXPECT_TRUE(refused("/filter", "QUATERNION"));
  EXPECT_TRUE(refused("/buffer", 1));
  EXPECT_FALSE(refused("/filter", "NONE"));
}

/// Draco data of a mesh: positions as attribute 0, normals as attribute 1.
Bytes encode_draco(const TriangleMesh& mesh, int method) {
  draco::TriangleSoupMeshBuilder soup;
  soup.Start(int(mesh.triangle_count()));
  const int positions = soup.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int normals = soup.AddAttribute(draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
  for (std::uint32_t i = 0; i < mesh.triangle_count(); ++i) {
    const auto p = mesh.corners(i);
    const Vec3f n[3] = {glm::normalize(p[0]), glm::normalize(p[1]), glm::normalize(p[2])};
    soup.SetAttributeValuesForFace(positions, draco::FaceIndex(i), &p[0], &p[1], &p[2]);
    soup.SetAttributeValuesForFace(normals, draco::FaceIndex(i), &n[0], &n[1], &n[2]);
  }
  const auto encoded_mesh = soup.Finalize();
  draco::Encoder encoder;
  encoder.SetEncodingMethod(method);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 16);
  draco::EncoderBuffer buffer;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(*encoded_mesh, &buffer).ok());
  const auto* data = reinterpret_cast<const std::byte*>(buffer.data());
  return {data, data + buffer.size()};
}

GltfBuilder draco_document(const Bytes& packed, std::size_t vertices, std::size_t indices) {
  GltfBuilder builder;
  builder.document["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  const int view = builder.add_view(packed);
  const int positions = builder.describe_accessor("VEC3", 5126, vertices, -1);
  const int normals = builder.describe_accessor("VEC3", 5126, vertices, -1);
  const int corners = builder.describe_accessor("SCALAR", 5123, indices, -1);
  const nlohmann::json draco = {{"bufferView", view}, {"attributes", {{"POSITION", 0}, {"NORMAL", 1}}}};
  builder.add_node({{"mesh", builder.add_mesh({{"attributes", {{"POSITION", positions}, {"NORMAL", normals}}},
                                               {"indices", corners},
                                               {"extensions", {{"KHR_draco_mesh_compression", draco}}}})}});
  return builder;
}

TEST(GltfDraco, both_methods_decode_to_a_closed_sphere) {
  const TriangleMesh sphere = icosphere(2);
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const auto packed = encode_draco(sphere, method);
    const auto scene =
        import_ok(draco_document(packed, sphere.positions.size(), 3 * sphere.triangle_count()).glb());
    ASSERT_EQ(scene.meshes.size(), 1U);
    const TriangleMesh& mesh = *scene.meshes[0];
    EXPECT_EQ(mesh.triangle_count(), sphere.triangle_count());
    ASSERT_EQ(mesh.positions.size(), sphere.positions.size());
    ASSERT_EQ(mesh.normals.size(), sphere.positions.size());
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      EXPECT_NEAR(double(glm::length(mesh.positions[i])), 1.0, 1e-4);
      EXPECT_GT(glm::dot(mesh.positions[i], mesh.normals[i]), 0.99F);
    }
  }
}

TEST(GltfDraco, other_counts_than_the_accessors_declare_are_refused) {
  const TriangleMesh sphere = icosphere(1);
  const auto packed = encode_draco(sphere, draco::MESH_EDGEBREAKER_ENCODING);
  const std::size_t vertices = sphere.positions.size(), indices = 3 * sphere.triangle_count();
  EXPECT_TRUE(io::import_gltf(draco_document(packed, vertices, indices).glb()).ok());
  EXPECT_EQ(import_error(draco_document(packed, vertices + 1, indices).glb()).code, ErrorCode::kInvalidFile);
  EXPECT_EQ(import_error(draco_document(packed, vertices, indices + 3).glb()).code, ErrorCode::kInvalidFile);
}

TEST(GltfDraco, every_cut_and_a_header_that_claims_billions_are_refused) {
  const TriangleMesh sphere = icosphere(0);
  for (const int method : {draco::MESH_SEQUENTIAL_ENCODING, draco::MESH_EDGEBREAKER_ENCODING}) {
    const Bytes packed = encode_draco(sphere, method);
    for (std::size_t length = 1; length + 8 < packed.size(); ++length) {
      const Bytes cut(packed.begin(), packed.begin() + std::ptrdiff_t(length));
      EXPECT_FALSE(io::import_gltf(draco_document(cut, 12, 60).glb()).ok())
          << length << " of " << packed.size();
    }
    Bytes boast = packed;
    for (std::size_t i = 11; i < 21; ++i) boast[i] = std::byte{0xFF};
    boast[method == draco::MESH_EDGEBREAKER_ENCODING ? 16 : 15] = std::byte{0x0F};
    EXPECT_FALSE(io::import_gltf(draco_document(boast, 12, 60).glb()).ok());
  }
}

}  // namespace
}  // namespace gridcast::test
