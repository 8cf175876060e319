#include "core/measure/scene_snapshot.h"

namespace gridcast::measure {

scene::SceneData snapshot_of(const scene::Scene& scene) {
  scene::SceneData data;
  data.name = scene.data().name;
  for (std::uint32_t id = 0; id < scene.mesh_count(); ++id) data.meshes.push_back(scene.blas(id).mesh_ptr());
  data.deformations.resize(data.meshes.size());
  for (std::uint32_t id = 0; id < scene.instance_slots(); ++id) {
    const scene::Instance* instance = scene.find_instance(id);
    scene::InstanceData& placed = data.instances.emplace_back();
    placed.mesh_id = instance != nullptr ? instance->mesh_id : 0;
    placed.world_from_object =
        instance != nullptr ? instance->transform.world_from_object() : Affine{Mat3d(0.0), Vec3d(0.0)};
  }
  return data;
}

}  // namespace gridcast::measure
