#include "core/scene/update.h"

#include <chrono>
#include <new>

#include "core/scene/mesh_edits.h"
#include "core/scene/pose_edits.h"

namespace gridcast::scene {
namespace {

Error error_at(std::size_t edit_index, const Error& error) {
  return {error.code, error.message, "/edits/" + std::to_string(edit_index) + error.where};
}

/// Applies the edits of one update in order to a copy of the scene. Boxes and structures of edited meshes
/// follow at the end, once each.
class Update {
 public:
  Update(const Scene& scene, const UpdateOptions& options) : editor_(scene), mesh_edits_(options.rebuilds) {}

  Status operator()(const AddInstance& edit) {
    if (edit.mesh_id >= scene().mesh_count())
      return Error{ErrorCode::kNotFound, "there is no mesh " + std::to_string(edit.mesh_id), "/mesh_id"};
    if (scene().instance_slots() >= kInvalidId - 1)
      return Error{ErrorCode::kLimitExceeded, "all instance ids are used", ""};
    const InstanceTransform transform(edit.world_from_object);
    if (!transform.active()) return singular_transform("/world_from_object");
    touched_.push_back(editor_.add_instance(transform, {edit.mesh_id, true, edit.mask}, edit.name));
    report_.added_instances.push_back(touched_.back());
    return ok_status();
  }

  Status operator()(const RemoveInstance& edit) {
    if (!scene().find_instance(edit.instance_id)) return no_instance(edit.instance_id);
    editor_.remove_instance(edit.instance_id);
    touched_.push_back(edit.instance_id);
    return ok_status();
  }

  Status operator()(const MoveInstance& edit) {
    if (!scene().find_instance(edit.instance_id)) return no_instance(edit.instance_id);
    return move(edit.instance_id, edit.world_from_object);
  }

  Status operator()(const ChangeInstance& edit) {
    if (!scene().find_instance(edit.instance_id)) return no_instance(edit.instance_id);
    // A mask moves nothing: the top level keeps every instance, whoever sees it.
    if (edit.mask) editor_.set_mask(edit.instance_id, *edit.mask);
    if (edit.name) editor_.set_name(edit.instance_id, *edit.name);
    return edit.world_from_object ? move(edit.instance_id, *edit.world_from_object) : ok_status();
  }

  Status operator()(const MoveInstances& edit) {
    if (Status status = editor_.move_instances(edit.moves); !status)
      return Error{status.error().code, status.error().message, "/moves" + status.error().where};
    return ok_status();
  }

  Status operator()(const ReplaceVertices& edit) { return mesh_edits_.add(scene(), edit, edit_index_); }

  Status operator()(const SetPose& edit) {
    return pose_edits_.apply(edit, edit_index_, editor_, mesh_edits_, touched_);
  }

  Status operator()(const AddMesh& edit) {
    if (edit.mesh == nullptr) return Error{ErrorCode::kInvalidArgument, "there is no mesh to add", "/mesh"};
    if (Status status = mesh::validate(*edit.mesh); !status)
      return Error{status.error().code, status.error().message, "/mesh" + status.error().where};
    auto built = blas::Blas::build(edit.mesh, scene().blas_options());
    if (!built) return Error{built.error().code, built.error().message, "/mesh" + built.error().where};
    report_.added_meshes.push_back(std::uint32_t(scene().mesh_count()));
    editor_.add_mesh(*std::move(built));
    return ok_status();
  }

  Result<UpdateResult> run(const std::vector<SceneEdit>& edits) {
    const auto start = std::chrono::steady_clock::now();
    for (edit_index_ = 0; edit_index_ < edits.size(); ++edit_index_) {
      const Status status = std::visit([&](const auto& edit) { return (*this)(edit); }, edits[edit_index_]);
      if (!status) return error_at(edit_index_, status.error());
    }
    if (Status status = mesh_edits_.apply(editor_); !status) return status.error();
    report_.meshes = mesh_edits_.reports();
    report_.poses = pose_edits_.reports(mesh_edits_);
    touch_instances_of_edited_meshes();
    editor_.update_top_level(std::move(touched_));
    report_.ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    return UpdateResult{editor_.publish(), std::move(report_)};
  }

 private:
  [[nodiscard]] const Scene& scene() const { return editor_.scene(); }

  static Error no_instance(std::uint32_t instance_id) {
    return {ErrorCode::kNotFound, "there is no instance " + std::to_string(instance_id), "/instance_id"};
  }

  Status move(std::uint32_t instance_id, const Affine& world_from_object) {
    const InstanceTransform transform(world_from_object);
    if (!transform.active()) return singular_transform("/world_from_object");
    editor_.move_instance(instance_id, transform);
    touched_.push_back(instance_id);
    return ok_status();
  }

  void touch_instances_of_edited_meshes() {
    if (mesh_edits_.empty()) return;
    for (std::uint32_t id = 0; id < scene().instance_slots(); ++id)
      if (mesh_edits_.edited(scene().instance(id).mesh_id)) touched_.push_back(id);
  }

  SceneEditor editor_;
  MeshEdits mesh_edits_;
  PoseEdits pose_edits_;
  std::vector<std::uint32_t> touched_;  // instances whose box may have changed, but by MoveInstances
  UpdateReport report_;
  std::size_t edit_index_ = 0;
};

}  // namespace

std::string_view to_string(UpdateMode mode) {
  switch (mode) {
    case UpdateMode::kAuto:
      return "auto";
    case UpdateMode::kRefit:
      return "refit";
    case UpdateMode::kRebuild:
      return "rebuild";
  }
  return "";
}

Result<UpdateMode> parse_update_mode(std::string_view name) {
  for (const UpdateMode mode : {UpdateMode::kAuto, UpdateMode::kRefit, UpdateMode::kRebuild})
    if (name == to_string(mode)) return mode;
  return Error{ErrorCode::kInvalidArgument, "update mode must be auto, refit or rebuild", ""};
}

std::string_view to_string(MeshAction action) {
  return action == MeshAction::kRefit ? "refit" : "rebuild";
}

Result<UpdateResult> apply_update(const Scene& scene, const std::vector<SceneEdit>& edits,
                                  const UpdateOptions& options) try {
  return Update(scene, options).run(edits);
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the update", ""};
}

}  // namespace gridcast::scene
