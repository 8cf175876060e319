#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "core/scene/update.h"

namespace gridcast::scene {

/// What is said of a transform that is not active.
[[nodiscard]] Error singular_transform(std::string where);

/// The one door to a Scene's insides: build_scene and apply_update make a new version through it, then it
/// is published as const.
class SceneEditor {
 public:
  SceneEditor() : scene_(std::make_shared<Scene>()) {}
  /// A copy of `scene` that shares all its memory, one version on. `scene` outlives the editor.
  explicit SceneEditor(const Scene& scene) : scene_(std::make_shared<Scene>(scene)) { ++scene_->version_; }

  [[nodiscard]] const Scene& scene() const { return *scene_; }

  void set_version(std::uint64_t version) { scene_->version_ = version; }
  void set_data(std::shared_ptr<const SceneData> data, std::shared_ptr<const Rig> rig) {
    scene_->data_ = std::move(data);
    scene_->rig_ = std::move(rig);
  }
  void set_pose(std::shared_ptr<const Pose> pose) { scene_->pose_ = std::move(pose); }
  void set_blas_options(const blas::BuildOptions& options) { scene_->blas_options_ = options; }
  void add_mesh(blas::Blas blas) {
    scene_->hulls_.push_back(std::make_shared<MeshHull>(blas.mesh(), blas.bounds()));
    scene_->blas_.push_back(std::move(blas));
  }
  /// Same triangle count as before. Different meshes may be set from different threads. The caller updates
  /// the boxes of the mesh's instances (update_top_level).
  void set_mesh(std::uint32_t mesh_id, blas::Blas blas) {
    scene_->hulls_[mesh_id] = std::make_shared<MeshHull>(blas.mesh(), blas.bounds());
    scene_->blas_[mesh_id] = std::move(blas);
  }
  /// Another tree over the same vertices.
  void set_tree(std::uint32_t mesh_id, blas::Blas blas) { scene_->blas_[mesh_id] = std::move(blas); }

  void reserve_instances(std::size_t count) { scene_->instances_.grow(count); }
  /// Writes a slot; different chunks of slots may be written from different threads.
  void set_instance(std::uint32_t instance_id, const InstanceTransform& transform, const InstanceSlot& slot) {
    move_instance(instance_id, transform);
    scene_->instances_.write_slot(instance_id) = slot;
  }
  void move_instance(std::uint32_t instance_id, const InstanceTransform& transform) {
    scene_->instances_.transforms().write(instance_id) = transform;
  }
  void set_mask(std::uint32_t instance_id, InstanceMask mask) {
    scene_->instances_.write_slot(instance_id).mask = mask;
  }
  /// In place of the name that the instance has.
  void set_name(std::uint32_t instance_id, const std::string& name);
  /// Many at once, each at most once, in parallel, with their boxes. Fails with the first move that is wrong,
  /// `/3/instance_id` (kNotFound, kInvalidArgument for a second move of an instance) or
  /// `/3/world_from_object` (kInvalidArgument); the editor is of no use then.
  [[nodiscard]] Status move_instances(std::span<const MoveInstance> moves);
  std::uint32_t add_instance(const InstanceTransform& transform, const InstanceSlot& slot,
                             const std::string& name);
  void add_name(std::uint32_t instance_id, const std::string& name) {
    scene_->added_names_.push_back({instance_id, name});
  }
  void remove_instance(std::uint32_t instance_id);
  /// Counts instances and triangles anew; add_ and remove_instance keep them up to date.
  void count_instances();

  void set_top_level(tlas::TopLevel top_level) { scene_->top_level_ = std::move(top_level); }
  /// Brings the top level up to date: the boxes of these instances (any order, repeats allowed), and of those
  /// that move_instances() has moved. At most once, after all else.
  void update_top_level(std::vector<std::uint32_t> instance_ids);
  /// The box of a slot as the top level needs it; empty for a dead one.
  [[nodiscard]] tlas::InstanceBox hit_box_of(std::uint32_t instance_id) const;

  [[nodiscard]] std::shared_ptr<const Scene> publish() { return std::move(scene_); }

 private:
  /// The boxes as they come to be; the top level has those of before.
  tlas::BoxTable& boxes();

  std::shared_ptr<Scene> scene_;
  std::shared_ptr<std::map<std::uint32_t, std::string>> new_names_;  ///< the scene's, once they are its own
  std::optional<tlas::BoxTable> boxes_;
  std::vector<std::uint32_t> moved_;  ///< by move_instances: their boxes are in boxes_
};

}  // namespace gridcast::scene
