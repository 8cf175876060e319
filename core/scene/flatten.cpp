#include "core/scene/flatten.h"

#include <algorithm>

#include "core/scene/rig.h"

namespace gridcast::scene {

SceneData flattened(const Scene& scene) {
  const SceneData& source = scene.data();
  SceneData data;
  data.name = source.name;
  data.materials = source.materials;
  data.cameras = source.cameras;
  data.lights = source.lights;
  data.warnings = source.warnings;
  for (std::uint32_t m = 0; m < scene.mesh_count(); ++m) data.meshes.push_back(scene.blas(m).mesh_ptr());
  data.deformations.resize(data.meshes.size());
  data.instances.reserve(scene.instance_slots());
  for (std::uint32_t id = 0; id < scene.instance_slots(); ++id) {
    const Instance instance = scene.instance(id);
    InstanceData& placed = data.instances.emplace_back();
    placed.name = scene.instance_name(id);
    placed.mesh_id = instance.mesh_id;
    placed.world_from_object = instance.transform.world_from_object();
    if (!instance.alive) placed.world_from_object.linear = Mat3d(0.0);
  }
  return data;
}

bool is_flat(const SceneData& data) {
  const Rig rig = make_rig(data);
  return std::ranges::none_of(rig.meshes, [](const RigMesh& mesh) {
    return mesh.skin_id != kInvalidId ||
           std::ranges::any_of(mesh.weights, [](float weight) { return weight != 0.F; });
  });
}

}  // namespace gridcast::scene
