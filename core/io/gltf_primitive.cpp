#include "core/io/gltf_primitive.h"

#include <algorithm>
#include <numeric>
#include <optional>

#include "core/io/gltf_draco.h"

namespace gridcast::io {
namespace {

using Attributes = std::map<std::string, int>;

const tinygltf::Value* draco_of(const tinygltf::Primitive& primitive) {
  const auto found = primitive.extensions.find("KHR_draco_mesh_compression");
  return found == primitive.extensions.end() ? nullptr : &found->second;
}

/// Where the attributes of one primitive come from: accessors, or the Draco data for those it holds.
class AttributeSource {
 public:
  AttributeSource(ImportContext& context, const tinygltf::Primitive& primitive, const std::string& where)
      : context_(context), primitive_(primitive), where_(where), packed_(draco_of(primitive)) {
    if (packed_ == nullptr) return;
    const auto data = context.storage.view(packed_->Get("bufferView").GetNumberAsInt());
    draco_.emplace(data, context.storage.budget(), where + "/extensions/KHR_draco_mesh_compression");
    check_draco_counts();
  }

  [[nodiscard]] int accessor(const std::string& name) const {
    const auto found = primitive_.attributes.find(name);
    return found == primitive_.attributes.end() ? -1 : found->second;
  }
  [[nodiscard]] std::vector<float> floats(const std::string& name, std::size_t components) {
    const int id = draco_id(name);
    if (id < 0) return context_.storage.floats(accessor(name), components);
    std::vector<float> values = draco_->floats(std::uint32_t(id), components);
    normalize(context_.storage.accessor(accessor(name)), values);
    return values;
  }
  [[nodiscard]] std::vector<std::uint32_t> integers(const std::string& name, std::size_t components) {
    const int id = draco_id(name);
    return id < 0 ? context_.storage.integers(accessor(name), components)
                  : draco_->integers(std::uint32_t(id), components);
  }
  [[nodiscard]] std::vector<std::uint32_t> indices(std::size_t vertices) {
    if (draco_) return draco_->indices();
    if (primitive_.indices >= 0) return context_.storage.integers(primitive_.indices, 1);
    context_.storage.budget().take(vertices, sizeof(std::uint32_t), where_);
    std::vector<std::uint32_t> counting(vertices);
    std::iota(counting.begin(), counting.end(), 0U);
    return counting;
  }

 private:
  [[nodiscard]] int draco_id(const std::string& name) const {
    if (packed_ == nullptr) return -1;
    const auto& ids = packed_->Get("attributes");
    return ids.Has(name) ? ids.Get(name).GetNumberAsInt() : -1;
  }
  void check_draco_counts() const {
    const int position = accessor("POSITION");
    const bool vertices_fit = position < 0 || context_.storage.count(position) == draco_->vertex_count();
    const bool indices_fit =
        !packed_->Has("indices") ||
        context_.storage.count(packed_->Get("indices").GetNumberAsInt()) == 3 * draco_->face_count();
    if (!vertices_fit || !indices_fit)
      refuse_invalid("the Draco data has other counts than the accessors declare", where_);
  }
  /// Draco hands out stored integers; the accessor says whether they are fractions.
  static void normalize(const tinygltf::Accessor& accessor, std::vector<float>& values) {
    if (!accessor.normalized) return;
    float scale = 1.F;
    if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_BYTE) scale = 127.F;
    if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE) scale = 255.F;
    if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_SHORT) scale = 32767.F;
    if (accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT) scale = 65535.F;
    for (float& value : values) value = std::max(value / scale, -1.F);
  }

  ImportContext& context_;
  const tinygltf::Primitive& primitive_;
  std::string where_;
  const tinygltf::Value* packed_;
  std::optional<DracoMesh> draco_;
};

std::vector<Vec3f> to_vectors(const std::vector<float>& values) {
  std::vector<Vec3f> vectors(values.size() / 3);
  for (std::size_t i = 0; i < vectors.size(); ++i)
    vectors[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
  return vectors;
}

/// Positions and displacements are refused, not repaired: a ray caster must not guess.
void check_finite(const std::vector<Vec3f>& values, int accessor) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (is_finite(values[i]) && max_abs(values[i]) <= mesh::kMaxCoordinate) continue;
    refuse_invalid("element " + std::to_string(i) + " is not finite or larger than 1e18",
                   pointer("accessors", std::size_t(accessor)));
  }
}

void read_influences(AttributeSource& source, ImportContext& context, const std::string& where,
                     PrimitiveVertices& out) {
  const std::size_t n = out.positions.size();
  std::vector<std::vector<std::uint32_t>> joints;
  std::vector<std::vector<float>> weights;
  for (const char* set : {"0", "1"}) {
    const std::string joint_name = std::string("JOINTS_") + set, weight_name = std::string("WEIGHTS_") + set;
    if ((source.accessor(joint_name) < 0) != (source.accessor(weight_name) < 0))
      context.warnings.add(where + ": joints and weights come in pairs; the unpaired ones are ignored");
    if (source.accessor(joint_name) < 0 || source.accessor(weight_name) < 0) break;
    joints.push_back(source.integers(joint_name, 4));
    weights.push_back(source.floats(weight_name, 4));
    if (joints.back().size() != 4 * n || weights.back().size() != 4 * n)
      refuse_invalid("joints and weights must have one element per vertex", where);
  }
  out.influences = std::uint32_t(4 * joints.size());
  for (std::size_t v = 0; v < n; ++v) {
    for (std::size_t i = 0; i < out.influences; ++i) {
      const float weight = weights[i / 4][4 * v + i % 4];
      const std::uint32_t joint = joints[i / 4][4 * v + i % 4];
      if (!std::isfinite(weight)) refuse_invalid("a joint weight is not finite", where + "/attributes");
      // Too large for any skin either way, and refused when the skin is known.
      out.joints.push_back(std::uint16_t(std::min(joint, 0xFFFFU)));
      out.weights.push_back(weight);
    }
  }
}

void read_targets(ImportContext& context, const tinygltf::Primitive& primitive, PrimitiveVertices& out,
                  const std::string& where) {
  const auto displacement = [&](const Attributes& target, const char* name) -> std::vector<Vec3f> {
    const auto found = target.find(name);
    if (found == target.end()) return {};
    auto values = to_vectors(context.storage.floats(found->second, 3));
    check_finite(values, found->second);
    if (values.size() != out.positions.size())
      refuse_invalid("a morph target must have one displacement per vertex", where + "/targets");
    return values;
  };
  for (const Attributes& target : primitive.targets)
    out.targets.push_back({displacement(target, "POSITION"), displacement(target, "NORMAL"), {}});
}

}  // namespace

PrimitiveData read_primitive(ImportContext& context, const tinygltf::Primitive& primitive,
                             const std::string& where) {
  AttributeSource source(context, primitive, where);
  PrimitiveData data;
  PrimitiveVertices& vertices = data.vertices;
  vertices.positions = to_vectors(source.floats("POSITION", 3));
  check_finite(vertices.positions, source.accessor("POSITION"));
  if (source.accessor("NORMAL") >= 0) vertices.normals = to_vectors(source.floats("NORMAL", 3));
  if (!vertices.normals.empty() && vertices.normals.size() != vertices.positions.size())
    refuse_invalid("there must be one normal per position", where);
  read_influences(source, context, where, vertices);
  read_targets(context, primitive, vertices, where);
  data.indices = source.indices(vertices.positions.size());
  for (std::size_t i = 0; i < data.indices.size(); ++i) {
    if (data.indices[i] < vertices.positions.size()) continue;
    refuse_invalid("index " + std::to_string(i) + " names vertex " + std::to_string(data.indices[i]) +
                       ", but there are " + std::to_string(vertices.positions.size()),
                   where + "/indices");
  }
  return data;
}

std::vector<mesh::Triangle> make_triangles(int mode, const std::vector<std::uint32_t>& indices) {
  const std::size_t n = indices.size();
  std::vector<mesh::Triangle> triangles;
  if (n < 3) return triangles;
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    triangles.reserve(n / 3);
    for (std::size_t i = 0; i + 2 < n; i += 3)
      triangles.push_back({indices[i], indices[i + 1], indices[i + 2]});
  } else if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
    triangles.reserve(n - 2);
    for (std::size_t i = 0; i + 2 < n; ++i)
      triangles.push_back({indices[i], indices[i + 1 + i % 2], indices[i + 2 - i % 2]});
  } else if (mode == TINYGLTF_MODE_TRIANGLE_FAN) {
    triangles.reserve(n - 2);
    for (std::size_t i = 0; i + 2 < n; ++i) triangles.push_back({indices[i + 1], indices[i + 2], indices[0]});
  }
  return triangles;
}

}  // namespace gridcast::io
