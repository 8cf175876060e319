#pragma once
// What of a scene has to be kept so that it answers the same after a restart: plain columns, without trees.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/scene/pose.h"
#include "core/scene/scene.h"

namespace gridcast::scene {

struct InstanceState {
  Affine world_from_object;
  std::uint32_t mesh_id = kInvalidId;
  bool alive = true;
  InstanceMask mask = kFullMask;
};

/// A slot of a version that is not what it was in the version before.
struct InstanceChange {
  std::uint32_t instance_id = kInvalidId;
  InstanceState state;
};

/// Name of an instance that came with an update.
struct InstanceName {
  std::uint32_t instance_id = kInvalidId;
  std::string name;
};

struct MeshState {
  std::shared_ptr<const mesh::TriangleMesh> mesh;
  blas::BuildOptions build;  ///< what its structure was asked to be
};

struct MeshChange {
  std::uint32_t mesh_id = kInvalidId;
  std::shared_ptr<const mesh::TriangleMesh> before;  ///< null for a mesh that was not there
  MeshState after;
};

/// One version, whole.
struct SceneState {
  std::uint64_t version = 1;
  blas::BuildOptions build;
  std::shared_ptr<const SceneData> data;
  std::shared_ptr<const Pose> pose;
  std::vector<MeshState> meshes;
  std::vector<InstanceState> instances;
  std::vector<InstanceName> added_names;           ///< ascending by id
  std::map<std::uint32_t, std::string> new_names;  ///< in place of those, and of the file's
};

/// What turns one version into a later one. Neither shrinks: ids are never reused.
struct SceneDelta {
  std::uint64_t version = 1;  ///< of the later one
  std::optional<Pose> pose;   ///< none where it stayed; its `nodes` are null where they did
  std::vector<InstanceChange> instances;
  std::vector<InstanceName> added_names;
  std::vector<MeshChange> meshes;
  std::map<std::uint32_t, std::string> new_names;  ///< that are not as before
};

[[nodiscard]] SceneState state_of(const Scene& scene);

/// Whatever edits lie between the two, which are versions of one scene. Linear in the slots of the chunks
/// that they do not share.
[[nodiscard]] SceneDelta difference(const Scene& before, const Scene& after);

/// A tree over the mesh of a state that somebody has kept, or none: then it is built. The mesh is valid.
/// Called from any thread.
using TreeFinder = std::function<std::optional<blas::Blas>(const MeshState& wanted)>;

/// The version, with structures that `find_tree` has or that are built anew: its answers are those of the
/// scene that the state was taken from, bit for bit. Errors: a state that no scene can have, named by a
/// pointer (`/meshes/3/positions/17`); kCancelled.
[[nodiscard]] Result<std::shared_ptr<const Scene>> restore_scene(SceneState state,
                                                                 const SceneBuildOptions& options = {},
                                                                 const TreeFinder& find_tree = {});

}  // namespace gridcast::scene
