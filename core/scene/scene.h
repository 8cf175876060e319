#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/blas/blas.h"
#include "core/math/chunked_vector.h"
#include "core/scene/instance_table.h"
#include "core/scene/mesh_hull.h"
#include "core/scene/scene_data.h"
#include "core/tlas/top_level.h"

namespace gridcast::scene {

struct Rig;
struct Pose;

/// An immutable snapshot. Any number of threads may query one while newer ones are made; snapshots share
/// all that an update did not touch.
class Scene {
 public:
  [[nodiscard]] std::uint64_t version() const { return version_; }

  [[nodiscard]] std::size_t mesh_count() const { return blas_.size(); }
  [[nodiscard]] const blas::Blas& blas(std::uint32_t mesh_id) const { return blas_[mesh_id]; }
  [[nodiscard]] const MeshHull& hull(std::uint32_t mesh_id) const { return *hulls_[mesh_id]; }
  [[nodiscard]] std::size_t instance_slots() const { return instances_.size(); }
  [[nodiscard]] std::size_t instance_count() const { return live_instances_; }
  /// None for an id out of range or a removed instance, which leaves a dead slot: ids are never reused.
  [[nodiscard]] std::optional<Instance> find_instance(std::uint32_t instance_id) const;
  [[nodiscard]] Instance instance(std::uint32_t instance_id) const { return instances_[instance_id]; }
  [[gnu::always_inline]] void prefetch_instance(std::uint32_t instance_id) const {
    instances_.prefetch(instance_id);
  }
  [[nodiscard]] const std::string& instance_name(std::uint32_t instance_id) const;

  /// What every structure was asked to be; meshes added by an update get the same.
  [[nodiscard]] const blas::BuildOptions& blas_options() const { return blas_options_; }
  [[nodiscard]] const tlas::TopLevel& top_level() const { return top_level_; }
  /// World box of all active instances, conservative; may be larger than needed after updates.
  [[nodiscard]] Bounds3d bounds() const { return top_level_.bounds(); }
  [[nodiscard]] std::uint64_t world_triangle_count() const { return world_triangles_; }  ///< of all instances
  [[nodiscard]] std::uint64_t stored_triangle_count() const;
  [[nodiscard]] std::size_t memory_bytes() const;
  /// What the file held beside geometry: materials, cameras, lights, nodes, skins, animations, warnings.
  /// Its `meshes` and `instances` are those of the file, not of this version.
  [[nodiscard]] const SceneData& data() const { return *data_; }
  [[nodiscard]] const Rig& rig() const { return *rig_; }
  /// How the file's nodes, skins and morph targets stand in this version (SetPose changes it). Instances and
  /// meshes that other edits moved since are elsewhere.
  [[nodiscard]] const Pose& pose() const { return *pose_; }

  /// Every invariant of the structures of both levels (slow; for tests and debugging).
  [[nodiscard]] Status validate() const;

 private:
  friend class SceneEditor;  // makes every new version: build_scene, apply_update and restore_scene
  friend class SceneKeeper;  // reads what has to be kept: scene_state.cpp

  /// Name of an instance that came with an update; those of the file are in data_. Unnamed ones take no room.
  struct AddedName {
    std::uint32_t instance_id = kInvalidId;
    std::string name;
  };

  std::uint64_t version_ = 1;
  blas::BuildOptions blas_options_;  ///< for meshes added later
  std::vector<blas::Blas> blas_;
  std::vector<std::shared_ptr<const MeshHull>> hulls_;  ///< one per mesh
  InstanceTable instances_;
  ChunkedVector<AddedName, 64> added_names_;  ///< ascending by id
  /// In place of the names that instances came with; null where none has another.
  std::shared_ptr<const std::map<std::uint32_t, std::string>> new_names_;
  std::size_t live_instances_ = 0;
  std::uint64_t world_triangles_ = 0;
  tlas::TopLevel top_level_;
  std::shared_ptr<const SceneData> data_;
  std::shared_ptr<const Rig> rig_;
  std::shared_ptr<const Pose> pose_;
};

using ProgressCallback =
    std::function<void(double fraction)>;  ///< called from any thread, fraction in [0, 1]

struct SceneBuildOptions {
  blas::BuildOptions blas;
  std::stop_token stop;
  ProgressCallback progress;
};

/// Version 1 of a scene: structures built in parallel, once per mesh. Instances whose transform is singular
/// are kept (they count, they keep their id) but never hit; a warning names them. Errors: an invalid mesh or
/// mesh_id (`/meshes/3/positions/17`), kCancelled.
[[nodiscard]] Result<std::shared_ptr<const Scene>> build_scene(SceneData data,
                                                               const SceneBuildOptions& options = {});

}  // namespace gridcast::scene
