#include "tests/support/gltf_builder.h"

#include <algorithm>

namespace gridcast::test {
namespace {

void append_u32(std::vector<std::byte>& to, std::size_t value) {
  for (int shift = 0; shift < 32; shift += 8) to.push_back(std::byte((value >> shift) & 0xFF));
}

void append_chunk(std::vector<std::byte>& to, std::uint32_t type, std::span<const std::byte> data,
                  std::byte padding) {
  append_u32(to, (data.size() + 3) / 4 * 4);
  append_u32(to, type);
  to.insert(to.end(), data.begin(), data.end());
  while (to.size() % 4 != 0) to.push_back(padding);
}

}  // namespace

std::size_t components_of(const std::string& type) {
  if (type == "SCALAR") return 1;
  if (type == "MAT4") return 16;
  return std::size_t(type.back() - '0');
}

GltfBuilder::GltfBuilder()
    : document({{"asset", {{"version", "2.0"}}},
                {"scene", 0},
                {"scenes", {{{"nodes", nlohmann::json::array()}}}}}) {}

int GltfBuilder::add_view(std::span<const std::byte> bytes, int stride) {
  while (bin.size() % 4 != 0) bin.push_back(std::byte{0});
  nlohmann::json view = {{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", bytes.size()}};
  if (stride != 0) view["byteStride"] = stride;
  bin.insert(bin.end(), bytes.begin(), bytes.end());
  document["bufferViews"].push_back(std::move(view));
  return int(document["bufferViews"].size()) - 1;
}

int GltfBuilder::describe_accessor(const std::string& type, int component, std::size_t count, int view,
                                   bool normalized) {
  nlohmann::json accessor = {{"type", type}, {"componentType", component}, {"count", count}};
  if (view >= 0) accessor["bufferView"] = view;
  if (normalized) accessor["normalized"] = true;
  document["accessors"].push_back(std::move(accessor));
  return int(document["accessors"].size()) - 1;
}

int GltfBuilder::add_mesh(nlohmann::json primitive) {
  nlohmann::json mesh;
  mesh["primitives"].push_back(std::move(primitive));
  document["meshes"].push_back(std::move(mesh));
  return int(document["meshes"].size()) - 1;
}

int GltfBuilder::add_node(nlohmann::json node, int parent) {
  document["nodes"].push_back(std::move(node));
  const int index = int(document["nodes"].size()) - 1;
  if (parent < 0) {
    document["scenes"][0]["nodes"].push_back(index);
  } else {
    document["nodes"][std::size_t(parent)]["children"].push_back(index);
  }
  return index;
}

std::vector<std::byte> GltfBuilder::glb() const {
  nlohmann::json whole = document;
  if (!bin.empty() && !whole.contains("buffers")) whole["buffers"] = {{{"byteLength", bin.size()}}};
  return make_glb(whole.dump(), bin);
}

std::vector<std::byte> GltfBuilder::text() const {
  nlohmann::json whole = document;
  whole["buffers"] = {
      {{"byteLength", bin.size()}, {"uri", "data:application/octet-stream;base64," + to_base64(bin)}}};
  return to_bytes(whole.dump());
}

std::vector<std::byte> make_glb(const std::string& json, std::span<const std::byte> bin) {
  std::vector<std::byte> bytes = to_bytes("glTF");
  append_u32(bytes, 2);
  append_u32(bytes, 0);
  append_chunk(bytes, 0x4E4F534A, to_bytes(json), std::byte{' '});
  if (!bin.empty()) append_chunk(bytes, 0x004E4942, bin, std::byte{0});
  std::vector<std::byte> length;
  append_u32(length, bytes.size());
  std::copy(length.begin(), length.end(), bytes.begin() + 8);
  return bytes;
}

std::vector<std::byte> to_bytes(const std::string& text) {
  const auto view = std::as_bytes(std::span(text));
  return {view.begin(), view.end()};
}

std::string to_base64(std::span<const std::byte> bytes) {
  static const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = (group << 8) | (i + k < bytes.size() ? std::uint32_t(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k)
      text += i + k <= bytes.size() ? digits[(group >> (18 - 6 * k)) & 63] : '=';
  }
  return text;
}

GltfBuilder triangle_document() {
  GltfBuilder builder;
  const int positions = builder.add_accessor<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  builder.add_node({{"mesh", builder.add_mesh({{"attributes", {{"POSITION", positions}}}})}});
  return builder;
}

}  // namespace gridcast::test
