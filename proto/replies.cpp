#include "proto/replies.h"

#include "proto/content_coding.h"
#include "proto/media_type.h"
#include "proto/replies_json.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

using Json = nlohmann::ordered_json;

Json vector_json(const Vec3d& v) {
  return Json::array({v.x, v.y, v.z});
}

/// {"lower": [x,y,z], "upper": [x,y,z]}, or null for an empty box.
Json bounds_json(const Bounds3d& bounds) {
  if (bounds.empty()) return nullptr;
  return {{"lower", vector_json(bounds.lower)}, {"upper", vector_json(bounds.upper)}};
}

Json scene_json(const SceneInfo& info) {
  Json json = {{"id", info.id},
               {"name", info.name},
               {"scene_version", std::to_string(info.version)},
               {"structure", info.structure},
               {"quality", info.quality},
               {"mesh_count", info.mesh_count},
               {"instance_count", info.instance_count},
               {"world_triangle_count", info.world_triangle_count},
               {"stored_triangle_count", info.stored_triangle_count},
               {"material_count", info.material_count},
               {"camera_count", info.camera_count},
               {"light_count", info.light_count},
               {"bounds", bounds_json(info.bounds)},
               {"memory_bytes", info.memory_bytes},
               {"import_ms", info.import_ms},
               {"build_ms", info.build_ms},
               {"warnings", info.warnings}};
  if (const auto& kept = info.kept) {
    json["kept_versions"] = {{"oldest", std::to_string(kept->oldest)},
                             {"newest", std::to_string(kept->newest)}};
    json["log_since"] = std::to_string(kept->log_since);
  }
  if (!info.rig) return json;
  json["animations"] = Json::array();
  for (const SceneInfo::Animation& animation : info.rig->animations)
    json["animations"].push_back({{"animation_id", json["animations"].size()},
                                  {"name", animation.name},
                                  {"duration_s", animation.duration_s}});
  json["skins"] = Json::array();
  for (const SceneInfo::Skin& skin : info.rig->skins)
    json["skins"].push_back(
        {{"skin_id", json["skins"].size()}, {"name", skin.name}, {"joint_ids", skin.joint_ids}});
  return json;
}

Json structure_json(const MeshStructureInfo& info) {
  return {{"mesh_id", info.mesh_id},
          {"kind", info.kind},
          {"reason", info.reason},
          {"quality_asked", info.quality_asked},
          {"quality", info.quality},
          {"quality_reason", info.quality_reason},
          {"triangle_count", info.triangle_count},
          {"node_count", info.node_count},
          {"leaf_count", info.leaf_count},
          {"reference_count", info.reference_count},
          {"max_depth", info.max_depth},
          {"memory_bytes", info.memory_bytes},
          {"cost", info.cost},
          {"cost_at_build", info.cost_at_build},
          {"looseness", info.looseness ? Json(*info.looseness) : Json()},
          {"looseness_at_build", info.looseness_at_build ? Json(*info.looseness_at_build) : Json()},
          {"steps_per_ray", info.steps_per_ray ? Json(*info.steps_per_ray) : Json()},
          {"build_ms", info.build_ms},
          {"refits_since_build", info.refits_since_build}};
}

Json topology_json(const MeshInfo::Topology& topology) {
  return {{"closed", topology.closed},
          {"edge_count", topology.edge_count},
          {"boundary_edges", topology.boundary_edges},
          {"non_manifold_edges", topology.non_manifold_edges},
          {"inconsistent_edges", topology.inconsistent_edges},
          {"degenerate_faces", topology.degenerate_faces},
          {"components", topology.components}};
}

Json mesh_json(const MeshInfo& info) {
  Json json = {{"mesh_id", info.mesh_id},
               {"name", info.name},
               {"vertex_count", info.vertex_count},
               {"triangle_count", info.triangle_count},
               {"instance_count", info.instance_count},
               {"bounds", bounds_json(info.bounds)},
               {"topology_version", info.topology_version},
               {"vertex_version", info.vertex_version},
               {"morph_target_count", info.morph_target_count},
               {"skin_id", info.skin_id ? Json(*info.skin_id) : Json(nullptr)},
               {"structure", structure_json(info.structure)}};
  if (info.topology) json["topology"] = topology_json(*info.topology);
  return json;
}

Json instance_json(const InstanceInfo& info) {
  return {{"instance_id", info.instance_id},
          {"mesh_id", info.mesh_id},
          {"name", info.name},
          {"transform", transform_json(info.world_from_object)},
          {"bounds", bounds_json(info.bounds)},
          {"active", info.active},
          {"mask", info.mask}};
}

/// `{"scene_version": "7"}`, ready for more members.
Json versioned(std::uint64_t scene_version) {
  return {{"scene_version", std::to_string(scene_version)}};
}

}  // namespace

std::string dump_json(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json transform_json(const Affine& transform) {
  Json rows = Json::array();
  for (int r = 0; r < 3; ++r) {
    rows.push_back(Json::array(
        {transform.linear[0][r], transform.linear[1][r], transform.linear[2][r], transform.translation[r]}));
  }
  return rows;
}

std::string to_json(const ServiceInfo& info) {
  return dump_json({{"name", "gridcast"},
                    {"version", info.version},
                    {"instruction_set", info.instruction_set},
                    {"threads", info.threads},
                    {"structures", kStructureNames},
                    {"qualities", kBuildQualityNames},
                    {"precisions", kPrecisionNames},
                    {"integrators", kIntegratorNames},
                    {"layers", kLayerNames},
                    {"ray_classes", kRayClassNames},
                    {"scene_media_types", {kGlbMediaType, kGltfMediaType, kJsonMediaType}},
                    {"ray_media_types", {kJsonMediaType, kRaysMediaType}},
                    {"hit_media_types", {kJsonMediaType, kHitsMediaType}},
                    {"image_media_types", {kPngMediaType, kExrMediaType}},
                    {"content_encodings", {kZstdCoding}},
                    {"limits", limits_json(info.limits)}});
}

std::string to_json(const SceneInfo& info) {
  return dump_json(scene_json(info));
}

std::string to_json(const std::vector<SceneInfo>& scenes, const std::vector<std::string>& damaged) {
  Json list = Json::array();
  for (const SceneInfo& info : scenes) list.push_back(scene_json(info));
  Json json{{"scenes", std::move(list)}};
  if (!damaged.empty()) json["damaged"] = damaged;
  return dump_json(json);
}

std::string to_json(const MeshInfo& info, std::uint64_t scene_version) {
  Json json = versioned(scene_version);
  json.update(mesh_json(info));
  return dump_json(json);
}

std::string to_json(const std::vector<MeshInfo>& meshes, std::uint64_t scene_version) {
  Json json = versioned(scene_version);
  json["meshes"] = Json::array();
  for (const MeshInfo& info : meshes) json["meshes"].push_back(mesh_json(info));
  return dump_json(json);
}

std::string to_json(const InstanceInfo& info, std::uint64_t scene_version) {
  Json json = versioned(scene_version);
  json.update(instance_json(info));
  return dump_json(json);
}

std::string to_json(const InstanceList& list) {
  Json json = versioned(list.scene_version);
  json["total"] = list.total;
  json["instances"] = Json::array();
  for (const InstanceInfo& info : list.instances) json["instances"].push_back(instance_json(info));
  json["next_offset"] = list.next_offset ? Json(*list.next_offset) : Json(nullptr);
  return dump_json(json);
}

std::string to_json(const StructureInfo& info) {
  const StructureInfo::TopLevel& top = info.top_level;
  Json json = versioned(info.scene_version);
  json["top_level"] = {{"kind", top.kind},
                       {"reason", top.reason},
                       {"cells", top.cells},
                       {"bounds", bounds_json(top.bounds)},
                       {"instance_count", top.instance_count},
                       {"cell_count", top.cell_count},
                       {"occupied_cells", top.occupied_cells},
                       {"reference_count", top.reference_count},
                       {"max_references_in_cell", top.max_references_in_cell},
                       {"memory_bytes", top.memory_bytes},
                       {"build_ms", top.build_ms}};
  json["meshes"] = Json::array();
  for (const MeshStructureInfo& mesh : info.meshes) json["meshes"].push_back(structure_json(mesh));
  return dump_json(json);
}

std::string to_json(const VertexReply& reply) {
  Json json = versioned(reply.scene_version);
  json["action"] = reply.action;
  json["reason"] = reply.reason;
  json["cost_before"] = reply.cost_before;
  json["cost_after"] = reply.cost_after;
  json["ms"] = reply.ms;
  return dump_json(json);
}

std::string to_json(const MovesReply& reply) {
  Json json = versioned(reply.scene_version);
  json["moved"] = reply.moved;
  json["ms"] = reply.ms;
  return dump_json(json);
}

std::string health_json(std::string_view status) {
  return dump_json({{"status", status}});
}

}  // namespace gridcast::proto
