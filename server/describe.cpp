#include "server/describe.h"

#include <utility>

#include "core/mesh/topology.h"
#include "core/scene/animation.h"
#include "core/scene/pose.h"
#include "core/scene/tree_watch.h"

namespace gridcast::server {
namespace {

std::vector<std::size_t> instances_per_mesh(const scene::Scene& scene) {
  std::vector<std::size_t> counts(scene.mesh_count(), 0);
  for (std::size_t i = 0; i < scene.instance_slots(); ++i)
    if (const auto instance = scene.find_instance(std::uint32_t(i))) ++counts[instance->mesh_id];
  return counts;
}

proto::SceneInfo::Rig rig_info(const scene::SceneData& data) {
  proto::SceneInfo::Rig rig;
  for (const scene::Animation& animation : data.animations)
    rig.animations.push_back({animation.name, duration_s(animation)});
  for (const scene::Skin& skin : data.skins) {
    auto& info = rig.skins.emplace_back();
    info.name = skin.name;
    for (const std::uint32_t joint : skin.joints) info.joint_ids.push_back(node_id(data, joint));
  }
  return rig;
}

/// Why a tree has the quality that it has.
std::string quality_reason(const blas::Blas& blas, blas::BuildQuality asked) {
  const blas::StructureKind kind = blas.stats().kind;
  if (kind != blas::StructureKind::kBvh && kind != blas::StructureKind::kWideBvh &&
      kind != blas::StructureKind::kCompactBvh)
    return "a " + std::string(to_string(kind)) + " is built in one way";
  if (blas.options().quality == asked) return "asked for";
  return "rebuilt by an update, in Morton order: more than " + std::to_string(scene::kFastRebuildTriangles) +
         " triangles";
}

std::optional<double> known(double looseness) {
  return looseness > 0.0 ? std::optional(looseness) : std::nullopt;
}

proto::MeshInfo mesh_info_without_topology(const scene::Scene& scene, std::uint32_t mesh_id,
                                           std::size_t instance_count) {
  const mesh::TriangleMesh& mesh = scene.blas(mesh_id).mesh();
  proto::MeshInfo info;
  info.mesh_id = mesh_id;
  info.name = mesh.name;
  info.vertex_count = mesh.positions.size();
  info.triangle_count = mesh.triangle_count();
  info.instance_count = instance_count;
  info.bounds = to_double(scene.blas(mesh_id).bounds());
  info.topology_version = mesh.topology_version;
  info.vertex_version = mesh.vertex_version;
  if (mesh_id < scene.rig().meshes.size()) {
    const scene::RigMesh& rigged = scene.rig().meshes[mesh_id];
    info.morph_target_count = rigged.weights.size();
    if (rigged.skin_id != kInvalidId) info.skin_id = rigged.skin_id;
  }
  info.structure = mesh_structure_info(scene, mesh_id);
  return info;
}

}  // namespace

proto::SceneInfo scene_info(const std::string& id, const SceneOrigin& origin, const scene::Scene& scene) {
  proto::SceneInfo info;
  info.id = id;
  info.name = scene.data().name.empty() ? id : scene.data().name;
  info.version = scene.version();
  info.structure = origin.structure;
  info.quality = to_string(scene.blas_options().quality);
  info.mesh_count = scene.mesh_count();
  info.instance_count = scene.instance_count();
  info.world_triangle_count = scene.world_triangle_count();
  info.stored_triangle_count = scene.stored_triangle_count();
  info.material_count = scene.data().materials.size();
  info.camera_count = scene.data().cameras.size();
  info.light_count = scene.data().lights.size();
  info.bounds = scene.bounds();
  info.memory_bytes = scene.memory_bytes();
  info.import_ms = origin.import_ms;
  info.build_ms = origin.build_ms;
  info.warnings = scene.data().warnings;
  info.rig = rig_info(scene.data());
  return info;
}

proto::SceneInfo scene_info(const NamedScene& named, const scene::Scene& scene) {
  proto::SceneInfo info = scene_info(named.id(), named.origin(), scene);
  const NamedScene::Kept kept = named.kept();
  info.kept = {kept.oldest, kept.newest, kept.log_since};
  return info;
}

proto::MeshStructureInfo mesh_structure_info(const scene::Scene& scene, std::uint32_t mesh_id) {
  const blas::Blas& blas = scene.blas(mesh_id);
  const blas::StructureStats& stats = blas.stats();
  const blas::BuildQuality asked = scene.blas_options().quality;
  return {mesh_id,
          std::string(to_string(stats.kind)),
          scene::reason_of(blas, asked),
          std::string(to_string(asked)),
          std::string(to_string(blas.options().quality)),
          quality_reason(blas, asked),
          stats.triangle_count,
          stats.node_count,
          stats.leaf_count,
          stats.reference_count,
          stats.max_depth,
          stats.memory_bytes,
          stats.cost,
          stats.cost_at_build,
          known(stats.looseness),
          known(stats.looseness_at_build),
          std::nullopt,
          stats.build_ms,
          stats.refits_since_build};
}

proto::MeshInfo mesh_info(const scene::Scene& scene, std::uint32_t mesh_id, TopologyDetail detail) {
  proto::MeshInfo info = mesh_info_without_topology(scene, mesh_id, instances_per_mesh(scene)[mesh_id]);
  if (detail == TopologyDetail::kCounted) {
    const mesh::TopologyReport report = analyse_topology(scene.blas(mesh_id).mesh());
    info.topology = {report.closed,
                     report.edge_count,
                     report.boundary_edges,
                     report.non_manifold_edges,
                     report.inconsistent_edges,
                     report.degenerate_faces,
                     report.components};
  }
  return info;
}

std::vector<proto::MeshInfo> mesh_infos(const scene::Scene& scene) {
  const std::vector<std::size_t> counts = instances_per_mesh(scene);
  std::vector<proto::MeshInfo> infos;
  infos.reserve(counts.size());
  for (std::size_t i = 0; i < counts.size(); ++i)
    infos.push_back(mesh_info_without_topology(scene, std::uint32_t(i), counts[i]));
  return infos;
}

proto::InstanceInfo instance_info(const scene::Scene& scene, std::uint32_t instance_id) {
  const scene::Instance instance = scene.instance(instance_id);
  proto::InstanceInfo info;
  info.instance_id = instance_id;
  info.mesh_id = instance.mesh_id;
  info.name = scene.instance_name(instance_id);
  info.world_from_object = instance.transform.world_from_object();
  info.active = instance.transform.active();
  info.mask = instance.mask;
  if (info.active) info.bounds = instance.transform.bounds_to_world(scene.blas(instance.mesh_id).bounds());
  return info;
}

proto::InstanceList instance_list(const scene::Scene& scene, const proto::Page& page) {
  proto::InstanceList list;
  list.scene_version = scene.version();
  list.total = scene.instance_count();
  for (std::size_t slot = page.offset; slot < scene.instance_slots(); ++slot) {
    if (list.instances.size() == page.limit) {
      list.next_offset = slot;
      break;
    }
    if (scene.find_instance(std::uint32_t(slot)))
      list.instances.push_back(instance_info(scene, std::uint32_t(slot)));
  }
  return list;
}

proto::StructureInfo structure_info(const scene::Scene& scene) {
  const tlas::TopLevelStats stats = scene.top_level().stats();
  proto::StructureInfo info;
  info.scene_version = scene.version();
  info.top_level = {std::string(to_string(stats.kind)),
                    stats.reason,
                    {stats.cells[0], stats.cells[1], stats.cells[2]},
                    stats.bounds,
                    stats.instance_count,
                    stats.cell_count,
                    stats.occupied_cells,
                    stats.reference_count,
                    stats.max_references_in_cell,
                    stats.memory_bytes,
                    stats.build_ms};
  for (std::size_t i = 0; i < scene.mesh_count(); ++i)
    info.meshes.push_back(mesh_structure_info(scene, std::uint32_t(i)));
  return info;
}

Status count_steps(const scene::Scene& scene, std::size_t rays, const std::stop_token& stop,
                   proto::StructureInfo& info) {
  for (proto::MeshStructureInfo& mesh : info.meshes) {
    const auto steps = scene.blas(mesh.mesh_id).steps_per_ray(rays, stop);
    if (!steps) return steps.error();
    mesh.steps_per_ray = *steps;
  }
  return ok_status();
}

}  // namespace gridcast::server
