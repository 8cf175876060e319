#pragma once
// The parts of the exporter, one concept a file. They throw Refusal.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/io/gltf_export.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::io {

/// Members come out in the order in which they went in.
using OrderedJson = nlohmann::ordered_json;

/// Text of `value`; what is no UTF-8 becomes U+FFFD.
[[nodiscard]] std::string json_text(const OrderedJson& value);

/// Vertices [first, first + count) of a mesh, which the primitives of that block share.
struct VertexBlock {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};
struct PrimitivePlan {
  mesh::MeshPart part;
  std::size_t block = 0;
};
/// How a mesh becomes primitives: one for each part that has triangles. The blocks cover the vertices in
/// order, so that an importer which joins them has the mesh's own numbering again, and no primitive repeats
/// the vertices of all.
struct MeshPlan {
  std::vector<VertexBlock> blocks;
  std::vector<PrimitivePlan> primitives;
};
[[nodiscard]] MeshPlan plan_mesh(const mesh::TriangleMesh& mesh);

/// Bytes that append_mesh appends: positions, normals, indices, each a multiple of 4.
[[nodiscard]] std::uint64_t binary_bytes(const mesh::TriangleMesh& mesh);
/// Adds the mesh with its accessors and buffer views, whose bytes begin at `offset` of the buffer.
void describe_mesh(const mesh::TriangleMesh& mesh, const MeshPlan& plan, std::uint64_t offset,
                   std::size_t material_count, OrderedJson& document);
void append_mesh(const mesh::TriangleMesh& mesh, const MeshPlan& plan, std::string& out);

[[nodiscard]] OrderedJson describe_material(const scene::Material& material);
[[nodiscard]] OrderedJson describe_camera(const scene::Camera& camera);
[[nodiscard]] OrderedJson describe_light(const scene::Light& light);
/// Place and direction of a light as a rotation; the light shines along its -z.
[[nodiscard]] Affine place_of(const scene::Light& light);

/// The arrays of nodes and of root nodes as text. A million instances are too many for a document of values.
class NodeText {
 public:
  explicit NodeText(const GltfLimits& limits) : limits_(limits) {}

  void add_instance(std::uint32_t mesh_id, const std::string& name, const Affine& world_from_object);
  /// The same, told what its instance was called.
  void add_renamed_instance(std::uint32_t mesh_id, const std::string& name, const Affine& world_from_object,
                            std::uint32_t instance_id);
  void add_camera(std::size_t camera, const Affine& world_from_camera);
  void add_light(std::size_t light, const Affine& world_from_light);

  /// The arrays, in brackets; "[]" when there is no node.
  [[nodiscard]] std::string take_nodes() &&;
  [[nodiscard]] std::string root_list() const;
  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  void begin();
  void end();
  void raw(std::string_view text) { text_.append(text); }
  void number(double value);
  void integer(std::uint64_t value);
  void transform(const Affine& affine);
  void numbers(std::string_view name, std::span<const double> values);

  const GltfLimits& limits_;
  std::string text_;
  std::size_t count_ = 0;
  std::size_t values_ = 0;  ///< of JSON, as the importer counts them
};

}  // namespace gridcast::io
