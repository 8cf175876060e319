#include "core/scene/pose_edits.h"

#include <map>

#include <tbb/parallel_for.h>

#include "core/scene/next_pose.h"

namespace gridcast::scene {
namespace {

/// Two poses of a scene, and what differs between them.
class PoseChange {
 public:
  PoseChange(const SceneData& data, const Rig& rig, const Pose& before, const Pose& after)
      : data_(data), rig_(rig), before_(before), after_(after) {
    if (before.nodes == after.nodes && before.joints == after.joints) return;
    for (std::uint32_t skin = 0; skin < data.skins.size(); ++skin) {
      std::vector<Affine> joints = joint_matrices(data, rig, after, skin);
      if (joints != joint_matrices(data, rig, before, skin)) joints_.emplace(skin, std::move(joints));
    }
  }

  /// Meshes whose joints or weights differ, ascending.
  [[nodiscard]] std::vector<std::uint32_t> changed_meshes() const {
    std::vector<std::uint32_t> changed;
    for (std::uint32_t m = 0; m < rig_.meshes.size(); ++m) {
      if (!rig_.meshes[m].deforms) continue;
      const bool other_weights =
          !rig_.meshes[m].weights.empty() && before_.weights.at(m) != after_.weights.at(m);
      if (other_weights || joints_.contains(rig_.meshes[m].skin_id)) changed.push_back(m);
    }
    return changed;
  }

  /// The vertices of `meshes` in the pose after. Many small meshes share the threads, and so do the vertices
  /// of a large one.
  [[nodiscard]] std::vector<mesh::DeformedVertices> deformed(const std::vector<std::uint32_t>& meshes) const {
    std::vector<mesh::DeformedVertices> vertices(meshes.size());
    tbb::parallel_for(std::size_t(0), meshes.size(), [&](std::size_t i) {
      vertices[i] = posed_vertices(data_, rig_, after_, meshes[i], joints_of(rig_.meshes[meshes[i]].skin_id));
    });
    return vertices;
  }

  /// Calls `move(instance_id, place)` for every instance of the file whose place differs.
  template <class Move>
  void for_moved_instances(const Move& move) const {
    if (before_.nodes == after_.nodes) return;
    for (std::uint32_t id = 0; id < data_.instances.size(); ++id) {
      const auto place = place_of(data_, rig_, *after_.nodes, id);
      if (place && !(*place == *place_of(data_, rig_, *before_.nodes, id))) move(id, *place);
    }
  }

 private:
  [[nodiscard]] std::vector<Affine> joints_of(std::uint32_t skin_id) const {
    if (skin_id == kInvalidId) return {};
    const auto known = joints_.find(skin_id);
    return known != joints_.end() ? known->second : joint_matrices(data_, rig_, after_, skin_id);
  }

  const SceneData& data_;
  const Rig& rig_;
  const Pose& before_;
  const Pose& after_;
  std::map<std::uint32_t, std::vector<Affine>> joints_;  ///< of skins that differ
};

/// What part of the edit gave a mesh vertices that cannot be: its weights, its skin's joints, or what moved
/// the nodes.
std::string blame(const SetPose& edit, const RigMesh& mesh, std::uint32_t mesh_id) {
  for (std::size_t i = 0; i < edit.weights.size(); ++i)
    if (edit.weights[i].mesh_id == mesh_id) return "/weights/" + std::to_string(i);
  if (mesh.skin_id != kInvalidId && !edit.skins.empty()) return "/skins";
  return edit.nodes.empty() ? "/animation" : "/nodes";
}

}  // namespace

Status PoseEdits::apply(const SetPose& edit, std::size_t edit_index, SceneEditor& editor, MeshEdits& meshes,
                        std::vector<std::uint32_t>& touched) {
  const Scene& scene = editor.scene();
  const SceneData& data = scene.data();
  auto next = next_pose(data, scene.rig(), scene.pose(), edit);
  if (!next) return next.error();
  const auto pose = std::make_shared<const Pose>(*std::move(next));
  const PoseChange change(data, scene.rig(), scene.pose(), *pose);

  Applied& applied = applied_.emplace_back();
  applied.meshes = change.changed_meshes();
  std::vector<mesh::DeformedVertices> vertices = change.deformed(applied.meshes);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::uint32_t mesh_id = applied.meshes[i];
    const Status status = meshes.pose(mesh_id, std::move(vertices[i]), edit.mode, edit_index);
    if (!status)
      return Error{status.error().code,
                   "the pose moves a vertex of mesh " + std::to_string(mesh_id) + " out of range",
                   blame(edit, scene.rig().meshes[mesh_id], mesh_id)};
  }
  change.for_moved_instances([&](std::uint32_t id, const Affine& place) {
    if (!scene.find_instance(id)) return;
    const InstanceTransform transform(place);
    editor.move_instance(id, transform);
    touched.push_back(id);
    ++applied.report.moved_instances;
    if (!transform.active()) ++applied.report.inactive_instances;
  });
  editor.set_pose(pose);
  return ok_status();
}

std::vector<PoseReport> PoseEdits::reports(const MeshEdits& meshes) const {
  std::vector<PoseReport> reports;
  for (const Applied& applied : applied_) {
    PoseReport& report = reports.emplace_back(applied.report);
    for (const std::uint32_t mesh_id : applied.meshes) report.meshes.push_back(meshes.report(mesh_id));
  }
  return reports;
}

}  // namespace gridcast::scene
