#include <algorithm>
#include <cmath>

#include "core/io/gltf_import.h"
#include "core/io/gltf_primitive.h"

namespace gridcast::io {
namespace {

/// Builds one TriangleMesh and its deformation data from primitives in order.
class MeshBuilder {
 public:
  explicit MeshBuilder(ImportContext& context) : context_(context) {}

  void add(const tinygltf::Primitive& primitive, const std::string& where) {
    if (primitive.mode < TINYGLTF_MODE_TRIANGLES) {
      context_.warnings.add(where + ": points and lines are skipped");
      return;
    }
    if (!primitive.attributes.contains("POSITION")) {
      context_.warnings.add(where + ": a primitive without positions is skipped");
      return;
    }
    PrimitiveData data = read_primitive(context_, primitive, where);
    if (primitive.mode == TINYGLTF_MODE_TRIANGLES && data.indices.size() % 3 != 0)
      context_.warnings.add(where + ": the last, incomplete triangle is skipped");
    std::vector<mesh::Triangle> triangles = make_triangles(primitive.mode, data.indices);
    const std::uint32_t base = place_vertices(primitive, std::move(data.vertices));
    context_.storage.budget().take(triangles.size(), sizeof(mesh::Triangle), where);
    mesh_.parts.push_back({std::uint32_t(mesh_.triangles.size()), std::uint32_t(triangles.size()),
                           primitive.material < 0 ? kInvalidId : std::uint32_t(primitive.material)});
    for (const auto& [a, b, c] : triangles) mesh_.triangles.push_back({a + base, b + base, c + base});
  }

  [[nodiscard]] mesh::TriangleMesh take_mesh(std::string name) {
    mesh_.name = std::move(name);
    join_vertices();
    return std::move(mesh_);
  }
  [[nodiscard]] scene::MeshDeformation take_deformation(const std::vector<double>& weights) {
    if (!deformation_.morph_targets.empty()) {
      deformation_.default_weights.assign(deformation_.morph_targets.size(), 0.F);
      const std::size_t n = std::min(weights.size(), deformation_.morph_targets.size());
      for (std::size_t i = 0; i < n; ++i) deformation_.default_weights[i] = float(weights[i]);
    }
    return std::move(deformation_);
  }

 private:
  using Attributes = std::map<std::string, int>;
  struct Block {
    PrimitiveVertices vertices;
    std::uint32_t base;
    std::uint32_t count;
  };

  /// Primitives that name the same accessors share their vertices. Draco data is the primitive's own.
  std::uint32_t place_vertices(const tinygltf::Primitive& primitive, PrimitiveVertices vertices) {
    const std::uint32_t base = vertex_count_;
    if (primitive.extensions.empty()) {
      const auto [found, added] = placed_.try_emplace({primitive.attributes, primitive.targets}, base);
      if (!added) return found->second;
    }
    const auto count = std::uint32_t(vertices.positions.size());
    vertex_count_ += count;
    blocks_.push_back({std::move(vertices), base, count});
    return base;
  }

  void join_vertices();
  void join_normals();
  void join_influences();
  void join_targets();

  ImportContext& context_;
  mesh::TriangleMesh mesh_;
  scene::MeshDeformation deformation_;
  std::vector<Block> blocks_;
  std::map<std::pair<Attributes, std::vector<Attributes>>, std::uint32_t> placed_;
  std::uint32_t vertex_count_ = 0;
};

template <class T>
void append(std::vector<T>& to, const std::vector<T>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

void MeshBuilder::join_vertices() {
  if (blocks_.size() == 1) {
    mesh_.positions = std::move(blocks_[0].vertices.positions);
  } else {
    mesh_.positions.reserve(vertex_count_);
    for (const Block& block : blocks_) append(mesh_.positions, block.vertices.positions);
  }
  join_normals();
  join_influences();
  join_targets();
}

/// Twice what rounding its components to float may do to the length of a unit vector: such a normal stays as
/// it is, so that what was read and written is read again with the same bits.
constexpr double kUnitRounding = 0x1p-23;

/// Unit normals. A stored normal without a direction is replaced by that of the faces around its vertex.
void MeshBuilder::join_normals() {
  const bool all = std::ranges::all_of(blocks_, [](const Block& b) { return !b.vertices.normals.empty(); });
  if (!all) return;
  for (const Block& block : blocks_) append(mesh_.normals, block.vertices.normals);
  std::vector<bool> missing(mesh_.normals.size());
  bool any_missing = false;
  for (std::size_t i = 0; i < mesh_.normals.size(); ++i) {
    const Vec3d normal(mesh_.normals[i]);
    const double length = glm::length(normal);
    missing[i] = !(is_finite(normal) && length > 0.0);
    any_missing = any_missing || missing[i];
    if (std::abs(length - 1.0) <= kUnitRounding) continue;
    mesh_.normals[i] = missing[i] ? Vec3f(0.F) : Vec3f(normal / length);
  }
  if (!any_missing) return;
  std::vector<Vec3d> sums(mesh_.normals.size(), Vec3d(0.0));
  for (const auto& triangle : mesh_.triangles) {
    const Vec3d a(mesh_.positions[triangle[0]]);
    const Vec3d face =
        glm::cross(Vec3d(mesh_.positions[triangle[1]]) - a, Vec3d(mesh_.positions[triangle[2]]) - a);
    for (const std::uint32_t vertex : triangle) sums[vertex] += face;
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    if (!missing[i]) continue;
    const double length = glm::length(sums[i]);
    mesh_.normals[i] = length > 0.0 && is_finite(sums[i]) ? Vec3f(sums[i] / length) : Vec3f(0.F, 0.F, 1.F);
  }
}

void MeshBuilder::join_influences() {
  std::uint32_t most = 0;
  for (const Block& block : blocks_) most = std::max(most, block.vertices.influences);
  deformation_.influences = most;
  if (most == 0) return;
  context_.storage.budget().take(vertex_count_, std::size_t(most) * 6, "/meshes");
  for (const Block& block : blocks_) {
    const PrimitiveVertices& v = block.vertices;
    for (std::size_t i = 0; i < block.count; ++i) {
      for (std::uint32_t k = 0; k < most; ++k) {
        const bool given = k < v.influences;
        deformation_.joints.push_back(given ? v.joints[i * v.influences + k] : std::uint16_t(0));
        deformation_.weights.push_back(given ? v.weights[i * v.influences + k] : 0.F);
      }
    }
  }
}

void MeshBuilder::join_targets() {
  std::size_t count = 0;
  for (const Block& block : blocks_) count = std::max(count, block.vertices.targets.size());
  deformation_.morph_targets.resize(count);
  for (std::size_t t = 0; t < count; ++t) {
    for (auto member : {&scene::MorphTarget::positions, &scene::MorphTarget::normals}) {
      const bool any = std::ranges::any_of(blocks_, [&](const Block& block) {
        return t < block.vertices.targets.size() && !(block.vertices.targets[t].*member).empty();
      });
      if (!any) continue;
      std::vector<Vec3f>& joined = deformation_.morph_targets[t].*member;
      context_.storage.budget().take(vertex_count_, sizeof(Vec3f), "/meshes");
      for (const Block& block : blocks_) {
        if (t < block.vertices.targets.size()) append(joined, block.vertices.targets[t].*member);
        joined.resize(std::size_t(block.base) + block.count, Vec3f(0.F));
      }
    }
    make_sparse(deformation_.morph_targets[t]);
  }
}

}  // namespace

void import_meshes(ImportContext& context, scene::SceneData& out) {
  const auto& meshes = context.storage.model().meshes;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const std::string where = pointer("meshes", m);
    MeshBuilder builder(context);
    for (std::size_t p = 0; p < meshes[m].primitives.size(); ++p)
      builder.add(meshes[m].primitives[p], where + "/primitives/" + std::to_string(p));
    auto mesh = std::make_shared<mesh::TriangleMesh>(builder.take_mesh(meshes[m].name));
    if (const Status status = mesh::validate(*mesh); !status)
      refuse_invalid(status.error().message, where + status.error().where);
    out.meshes.push_back(std::move(mesh));
    out.deformations.push_back(builder.take_deformation(meshes[m].weights));
  }
}

}  // namespace gridcast::io
