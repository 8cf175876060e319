#include <algorithm>

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

/// Every joint that a skinned mesh names exists in the skin of each node that shows it.
void check_joints(const scene::SceneData& out) {
  std::vector<std::uint32_t> largest(out.deformations.size(), kInvalidId);
  for (const scene::Node& node : out.nodes) {
    if (node.skin_id == kInvalidId || node.mesh_id == kInvalidId) continue;
    const auto& joints = out.deformations[node.mesh_id].joints;
    if (joints.empty()) continue;
    std::uint32_t& most = largest[node.mesh_id];
    if (most == kInvalidId) most = *std::ranges::max_element(joints);
    if (most >= out.skins[node.skin_id].joints.size())
      refuse_invalid("the mesh names joint " + std::to_string(most) + ", which its skin does not have",
                     pointer("nodes", node.file_index) + "/skin");
  }
}

}  // namespace

void import_skins(ImportContext& context, const std::vector<std::uint32_t>& place, scene::SceneData& out) {
  for (const tinygltf::Skin& source : context.storage.model().skins)
    out.skins.push_back(make_skin(context, source, place));
  check_joints(out);
}

}  // namespace gridcast::io
