#pragma once
// Makes small GLB files in memory: a JSON document that tests edit freely, and its binary chunk.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include <nlohmann/json.hpp>

namespace gridcast::test {

/// glTF's component type of a C++ number.
template <class T>
constexpr int component_type() {
  if constexpr (std::is_same_v<T, std::int8_t>) return 5120;
  if constexpr (std::is_same_v<T, std::uint8_t>) return 5121;
  if constexpr (std::is_same_v<T, std::int16_t>) return 5122;
  if constexpr (std::is_same_v<T, std::uint16_t>) return 5123;
  if constexpr (std::is_same_v<T, std::uint32_t>) return 5125;
  if constexpr (std::is_same_v<T, float>) return 5126;
}

/// Components of a type name: 3 for "VEC3".
std::size_t components_of(const std::string& type);

class GltfBuilder {
 public:
  GltfBuilder();

  nlohmann::json document;     ///< without `buffers`, which glb() and text() add
  std::vector<std::byte> bin;  ///< the one buffer

  /// Each add_ returns the index of what it added.
  int add_view(std::span<const std::byte> bytes, int stride = 0);
  /// `type` is glTF's: "SCALAR", "VEC3", ...
  template <class T>
  int add_accessor(const std::string& type, const std::vector<T>& values, bool normalized = false) {
    const int view = add_view(std::as_bytes(std::span(values)));
    return describe_accessor(type, component_type<T>(), values.size() / components_of(type), view,
                             normalized);
  }
  int describe_accessor(const std::string& type, int component, std::size_t count, int view,
                        bool normalized = false);
  /// A mesh of one primitive.
  int add_mesh(nlohmann::json primitive);
  /// A node; `parent` < 0 makes it a root of scene 0.
  int add_node(nlohmann::json node, int parent = -1);

  [[nodiscard]] std::vector<std::byte> glb() const;
  /// glTF JSON with the buffer as a data URI.
  [[nodiscard]] std::vector<std::byte> text() const;
};

/// A GLB from any JSON text and chunk, right or wrong.
std::vector<std::byte> make_glb(const std::string& json, std::span<const std::byte> bin);
std::vector<std::byte> to_bytes(const std::string& text);
std::string to_base64(std::span<const std::byte> bytes);

/// One triangle (0,0,0) (1,0,0) (0,1,0), one mesh, one node.
GltfBuilder triangle_document();

}  // namespace gridcast::test
