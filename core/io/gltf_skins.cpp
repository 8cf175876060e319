#include <algorithm>
#include <map>

#include "core/io/gltf_import.h"
#include "core/io/gltf_transform.h"

namespace gridcast::io {
namespace {

scene::Skin make_skin(ImportContext& context, const tinygltf::Skin& source,
                      const std::vector<std::uint32_t>& place) {
  scene::Skin skin;
  skin.name = source.name;
  for (const int joint : source.joints) skin.joints.push_back(place[std::size_t(joint)]);
  if (source.skeleton >= 0) skin.skeleton = place[std::size_t(source.skeleton)];
  context.storage.budget().take(skin.joints.size(), sizeof(Affine), "/skins");
  skin.inverse_bind.resize(skin.joints.size());
  if (source.inverseBindMatrices < 0) return skin;
  const std::vector<float> numbers = context.storage.floats(source.inverseBindMatrices, 16);
  for (std::size_t j = 0; j < skin.joints.size(); ++j) {
    double matrix[16];
    std::copy_n(numbers.begin() + std::ptrdiff_t(16 * j), 16, matrix);
    skin.inverse_bind[j] = affine_from_matrix(matrix);
    if (!is_finite(skin.inverse_bind[j]))
      refuse_invalid("inverse bind matrix " + std::to_string(j) + " is not finite",
                     pointer("accessors", std::size_t(source.inverseBindMatrices)));
  }
  return skin;
}

/// The largest joint that the vertices of a mesh name, those of points and lines included; kInvalidId = none.
std::uint32_t largest_joint(ImportContext& context, std::uint32_t mesh, const scene::SceneData& out) {
  std::uint32_t largest = 0;
  bool any = false;
  const auto look = [&](const auto& joints) {
    if (joints.empty()) return;
    largest = std::max(largest, std::uint32_t(*std::ranges::max_element(joints)));
    any = true;
  };
  look(out.deformations[mesh].joints);
  for (const tinygltf::Primitive& primitive : context.storage.model().meshes[mesh].primitives) {
    if (primitive.mode >= TINYGLTF_MODE_TRIANGLES) continue;
    for (const char* name : {"JOINTS_0", "JOINTS_1"}) {
      const auto joints = primitive.attributes.find(name);
      if (joints != primitive.attributes.end()) look(context.storage.integers(joints->second, 4));
    }
  }
  return any ? largest : kInvalidId;
}

/// Every joint that a skinned mesh names exists in the skin of each node that shows it.
void check_joints(ImportContext& context, const scene::SceneData& out) {
  std::map<std::uint32_t, std::uint32_t> known;
  for (const scene::Node& node : out.nodes) {
    if (node.skin_id == kInvalidId || node.mesh_id == kInvalidId) continue;
    auto [entry, added] = known.try_emplace(node.mesh_id, kInvalidId);
    if (added) entry->second = largest_joint(context, node.mesh_id, out);
    if (entry->second == kInvalidId || entry->second < out.skins[node.skin_id].joints.size()) continue;
    refuse_invalid("the mesh names joint " + std::to_string(entry->second) + ", which its skin does not have",
                   pointer("nodes", node.file_index) + "/skin");
  }
}

}  // namespace

void import_skins(ImportContext& context, const std::vector<std::uint32_t>& place, scene::SceneData& out) {
  for (const tinygltf::Skin& source : context.storage.model().skins)
    out.skins.push_back(make_skin(context, source, place));
  check_joints(context, out);
}

}  // namespace gridcast::io
