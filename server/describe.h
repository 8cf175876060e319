#pragma once
// Scenes and their parts as the plain structs that proto writes.

#include <cstddef>
#include <stop_token>

#include "core/scene/scene.h"
#include "proto/query.h"
#include "proto/replies.h"
#include "server/scene_store.h"

namespace gridcast::server {

[[nodiscard]] proto::SceneInfo scene_info(const std::string& id, const SceneOrigin& origin,
                                          const scene::Scene& scene);
/// With what the server keeps of it now.
[[nodiscard]] proto::SceneInfo scene_info(const NamedScene& named, const scene::Scene& scene);
[[nodiscard]] proto::MeshStructureInfo mesh_structure_info(const scene::Scene& scene, std::uint32_t mesh_id);

/// kCounted analyses the mesh's topology: slow on large meshes.
enum class TopologyDetail { kLeftOut, kCounted };
[[nodiscard]] proto::MeshInfo mesh_info(const scene::Scene& scene, std::uint32_t mesh_id,
                                        TopologyDetail detail);
/// Of every mesh, without topology; one pass over the instances.
[[nodiscard]] std::vector<proto::MeshInfo> mesh_infos(const scene::Scene& scene);

/// `instance_id` is a live instance.
[[nodiscard]] proto::InstanceInfo instance_info(const scene::Scene& scene, std::uint32_t instance_id);
[[nodiscard]] proto::InstanceList instance_list(const scene::Scene& scene, const proto::Page& page);
[[nodiscard]] proto::StructureInfo structure_info(const scene::Scene& scene);
/// Sets steps_per_ray of the meshes of structure_info(scene), by so many rays each. kCancelled on `stop`.
[[nodiscard]] Status count_steps(const scene::Scene& scene, std::size_t rays, const std::stop_token& stop,
                                 proto::StructureInfo& info);

}  // namespace gridcast::server
