#include <algorithm>
#include <cstring>

#include "core/io/gltf_check.h"
#include "core/io/gltf_export_parts.h"

namespace gridcast::io {
namespace {

using mesh::MeshPart;
using mesh::TriangleMesh;

constexpr int kVertexTarget = 34962;  // ARRAY_BUFFER
constexpr int kIndexTarget = 34963;   // ELEMENT_ARRAY_BUFFER
constexpr int kPoints = 0;            // a primitive's mode

struct VertexRange {
  std::uint32_t lowest = kInvalidId;
  std::uint32_t highest = 0;
};
VertexRange range_of(const TriangleMesh& mesh, const MeshPart& part) {
  VertexRange range;
  for (std::uint32_t i = 0; i < part.triangle_count; ++i) {
    for (const std::uint32_t vertex : mesh.triangles[part.first_triangle + i]) {
      range.lowest = std::min(range.lowest, vertex);
      range.highest = std::max(range.highest, vertex);
    }
  }
  return range;
}

/// Where blocks end, so that each range lies in one. They follow each other without a gap.
void add_range(const VertexRange& range, std::vector<VertexBlock>& blocks) {
  const auto end_of = [](const VertexBlock& block) { return block.first + block.count; };
  while (blocks.size() > 1 && range.lowest < blocks.back().first) {
    const std::uint32_t end = end_of(blocks.back());
    blocks.pop_back();
    blocks.back().count = end - blocks.back().first;
  }
  if (blocks.empty() || range.lowest >= end_of(blocks.back()))
    blocks.push_back({blocks.empty() ? 0 : end_of(blocks.back()), 0});
  VertexBlock& last = blocks.back();
  last.count = std::max(last.count, range.highest + 1 - last.first);
}

std::size_t block_of(std::uint32_t vertex, const std::vector<VertexBlock>& blocks) {
  const auto after = std::ranges::upper_bound(blocks, vertex, {}, &VertexBlock::first);
  return std::size_t(after - blocks.begin()) - 1;
}

std::vector<MeshPart> parts_with_triangles(const TriangleMesh& mesh) {
  std::vector<MeshPart> parts = mesh.parts;
  if (parts.empty()) parts.push_back({0, std::uint32_t(mesh.triangle_count()), kInvalidId});
  std::erase_if(parts, [](const MeshPart& part) { return part.triangle_count == 0; });
  return parts;
}

std::size_t append(OrderedJson& array, OrderedJson element) {
  array.push_back(std::move(element));
  return array.size() - 1;
}

OrderedJson numbers_of(const Vec3f& v) {
  return OrderedJson::array({double(v.x), double(v.y), double(v.z)});
}

/// The accessors of a mesh, each a piece of one of its three buffer views.
class MeshDescriber {
 public:
  MeshDescriber(const TriangleMesh& mesh, std::uint64_t offset, OrderedJson& document)
      : mesh_(mesh), document_(document), end_(offset) {
    const std::size_t vertex_bytes = mesh.positions.size() * sizeof(Vec3f);
    positions_ = add_view(vertex_bytes, kVertexTarget);
    if (!mesh.normals.empty()) normals_ = add_view(vertex_bytes, kVertexTarget);
    if (mesh.triangle_count() != 0)
      indices_ = add_view(mesh.triangle_count() * sizeof(mesh::Triangle), kIndexTarget);
  }

  [[nodiscard]] OrderedJson attributes(const VertexBlock& block) {
    OrderedJson all{{"POSITION", add_positions(block)}};
    if (!mesh_.normals.empty()) all["NORMAL"] = append(document_["accessors"], vertices(normals_, block));
    return all;
  }
  [[nodiscard]] std::size_t add_indices(const MeshPart& part) {
    return append(document_["accessors"], {{"bufferView", indices_},
                                           {"byteOffset", part.first_triangle * sizeof(mesh::Triangle)},
                                           {"componentType", kUnsignedInt},
                                           {"count", 3 * std::size_t(part.triangle_count)},
                                           {"type", "SCALAR"}});
  }

 private:
  std::size_t add_view(std::size_t bytes, int target) {
    if (bytes == 0) return 0;
    OrderedJson view{{"buffer", 0}, {"byteOffset", end_}, {"byteLength", bytes}};
    // Accessors that share a view need it said.
    if (target == kVertexTarget) view["byteStride"] = sizeof(Vec3f);
    view["target"] = target;
    end_ += bytes;
    return append(document_["bufferViews"], std::move(view));
  }
  static OrderedJson vertices(std::size_t view, const VertexBlock& block) {
    return {{"bufferView", view},
            {"byteOffset", block.first * sizeof(Vec3f)},
            {"componentType", kFloat},
            {"count", block.count},
            {"type", "VEC3"}};
  }
  std::size_t add_positions(const VertexBlock& block) {
    // glTF has no accessor without elements; one without a view is zero.
    if (block.count == 0)
      return append(document_["accessors"], {{"componentType", kFloat},
                                             {"count", 1},
                                             {"type", "VEC3"},
                                             {"min", {0, 0, 0}},
                                             {"max", {0, 0, 0}}});
    Bounds3f box;
    for (std::uint32_t i = 0; i < block.count; ++i) box.extend(mesh_.positions[block.first + i]);
    OrderedJson accessor = vertices(positions_, block);
    accessor["min"] = numbers_of(box.lower);
    accessor["max"] = numbers_of(box.upper);
    return append(document_["accessors"], std::move(accessor));
  }

  const TriangleMesh& mesh_;
  OrderedJson& document_;
  std::uint64_t end_;
  std::size_t positions_ = 0, normals_ = 0, indices_ = 0;
};

template <class T>
void append_bytes(std::string& out, const std::vector<T>& values) {
  out.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

}  // namespace

MeshPlan plan_mesh(const TriangleMesh& mesh) {
  MeshPlan plan;
  const std::vector<MeshPart> parts = parts_with_triangles(mesh);
  const auto vertex_count = std::uint32_t(mesh.positions.size());
  if (parts.size() <= 1) {
    plan.blocks = {{0, vertex_count}};
    for (const MeshPart& part : parts) plan.primitives.push_back({part, 0});
    return plan;
  }
  std::vector<VertexRange> ranges;
  for (const MeshPart& part : parts) add_range(ranges.emplace_back(range_of(mesh, part)), plan.blocks);
  plan.blocks.back().count = vertex_count - plan.blocks.back().first;
  for (std::size_t i = 0; i < parts.size(); ++i)
    plan.primitives.push_back({parts[i], block_of(ranges[i].lowest, plan.blocks)});
  return plan;
}

std::uint64_t binary_bytes(const TriangleMesh& mesh) {
  return (mesh.positions.size() + mesh.normals.size()) * sizeof(Vec3f) +
         mesh.triangle_count() * sizeof(mesh::Triangle);
}

void describe_mesh(const TriangleMesh& mesh, const MeshPlan& plan, std::uint64_t offset,
                   std::size_t material_count, OrderedJson& document) {
  MeshDescriber describer(mesh, offset, document);
  std::vector<OrderedJson> attributes;
  for (const VertexBlock& block : plan.blocks) attributes.push_back(describer.attributes(block));
  OrderedJson described;
  if (!mesh.name.empty()) described["name"] = mesh.name;
  OrderedJson& primitives = described["primitives"] = OrderedJson::array();
  for (const PrimitivePlan& plan_of : plan.primitives) {
    OrderedJson primitive{{"attributes", attributes[plan_of.block]},
                          {"indices", describer.add_indices(plan_of.part)}};
    if (plan_of.part.material_id < material_count) primitive["material"] = plan_of.part.material_id;
    primitives.push_back(std::move(primitive));
  }
  if (primitives.empty()) primitives.push_back({{"attributes", attributes[0]}, {"mode", kPoints}});
  document["meshes"].push_back(std::move(described));
}

void append_mesh(const TriangleMesh& mesh, const MeshPlan& plan, std::string& out) {
  append_bytes(out, mesh.positions);
  append_bytes(out, mesh.normals);
  for (const PrimitivePlan& primitive : plan.primitives) {
    const std::uint32_t first = plan.blocks[primitive.block].first;
    for (std::uint32_t i = 0; i < primitive.part.triangle_count; ++i) {
      mesh::Triangle triangle = mesh.triangles[primitive.part.first_triangle + i];
      for (std::uint32_t& vertex : triangle) vertex -= first;
      char bytes[sizeof triangle];
      std::memcpy(bytes, triangle.data(), sizeof triangle);
      out.append(bytes, sizeof bytes);
    }
  }
}

}  // namespace gridcast::io
