#include "core/measure/scene_reference.h"

#include <utility>

#include "core/scene/flatten.h"

namespace gridcast::measure {

Result<exact::Reference> reference_of(const scene::SceneData& data, const std::stop_token& stop) {
  if (!scene::is_flat(data))
    return Error{ErrorCode::kUnsupported, "the reference reads meshes as they are: flatten the scene", {}};
  std::vector<exact::Mesh> meshes;
  meshes.reserve(data.meshes.size());
  for (const auto& mesh : data.meshes) meshes.push_back({mesh->positions, mesh->triangles});
  std::vector<exact::Instance> instances;
  for (std::size_t i = 0; i < data.instances.size(); ++i) {
    const scene::InstanceData& instance = data.instances[i];
    if (InstanceTransform(instance.world_from_object).active())
      instances.push_back({std::uint32_t(i), instance.mesh_id, instance.world_from_object});
  }
  return exact::Reference::build(std::move(meshes), std::move(instances), stop);
}

}  // namespace gridcast::measure
