#pragma once

#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/math/trs.h"
#include "core/scene/scene.h"
#include "core/scene/tree_watch.h"

namespace gridcast::scene {

struct AddInstance {
  std::uint32_t mesh_id = kInvalidId;
  Affine world_from_object;
  std::string name;
  InstanceMask mask = kFullMask;
};
struct RemoveInstance {
  std::uint32_t instance_id = kInvalidId;
};
struct MoveInstance {
  std::uint32_t instance_id = kInvalidId;
  Affine world_from_object;
};
/// Changes what is given, and nothing else.
struct ChangeInstance {
  std::uint32_t instance_id = kInvalidId;
  std::optional<Affine> world_from_object;
  std::optional<InstanceMask> mask;
  std::optional<std::string> name;
};
/// Many moves in one edit: no instance twice. Where an update moves many instances, this is the fast way.
struct MoveInstances {
  std::vector<MoveInstance> moves;
};

/// kAuto: refit where the structure can and the tree stays good, else rebuild.
enum class UpdateMode : std::uint8_t { kAuto, kRefit, kRebuild };
[[nodiscard]] std::string_view to_string(UpdateMode mode);  ///< auto, refit, rebuild
[[nodiscard]] Result<UpdateMode> parse_update_mode(std::string_view name);

/// New positions for vertices of a mesh, seen by all its instances. With `vertex_ids` empty `positions`
/// replaces all of them (same count), otherwise position k goes to vertex vertex_ids[k] (each at most once).
struct ReplaceVertices {
  std::uint32_t mesh_id = kInvalidId;
  std::vector<Vec3f> positions;
  std::vector<std::uint32_t> vertex_ids;
  UpdateMode mode = UpdateMode::kAuto;
};

/// Adds a mesh under the next free mesh_id.
struct AddMesh {
  std::shared_ptr<const mesh::TriangleMesh> mesh;
};

/// An animation, skin or node of the file: by its number there, or by a name that only one of them has.
using ElementRef = std::variant<std::uint32_t, std::string>;

/// Where a pose begins: with the file's rest pose, or with the present one.
enum class PoseBase : std::uint8_t { kRest, kPresent };
/// What a time outside of an animation means: its first or last moment, or it begins again.
enum class AnimationWrap : std::uint8_t { kClamp, kLoop };

struct AnimationTime {
  ElementRef animation;
  double time_s = 0.0;
  AnimationWrap wrap = AnimationWrap::kClamp;
};
/// Parts that are none stay as they are in the pose so far.
struct TrsParts {
  std::optional<Vec3d> translation;
  std::optional<std::array<double, 4>> rotation;  ///< quaternion x, y, z, w of any length but 0
  std::optional<Vec3d> scale;
};
struct NodeTransform {
  ElementRef node;
  std::variant<Affine, TrsParts> parent_from_node;
};
struct SkinJoints {
  ElementRef skin;
  /// One per joint, world_from_mesh: the joint's world transform times its inverse bind matrix.
  std::vector<Affine> joint_matrices;
};
struct MorphWeights {
  std::uint32_t mesh_id = kInvalidId;
  std::vector<double> weights;  ///< one per morph target
};

/// Poses the scene: first an animation, then nodes, then joints and weights in place of what these say, each
/// at most once. Instances whose place thereby changes move, meshes whose joints or weights change deform;
/// what other edits moved meanwhile stays where a pose changes nothing. A file's animation may squeeze an
/// instance to nothing: it is then never hit.
struct SetPose {
  PoseBase base = PoseBase::kRest;
  std::optional<AnimationTime> animation;
  std::vector<NodeTransform> nodes;
  std::vector<SkinJoints> skins;
  std::vector<MorphWeights> weights;
  UpdateMode mode = UpdateMode::kAuto;
};

using SceneEdit = std::variant<AddInstance, RemoveInstance, MoveInstance, MoveInstances, ReplaceVertices,
                               AddMesh, SetPose, ChangeInstance>;

enum class MeshAction : std::uint8_t { kRefit, kRebuild };
[[nodiscard]] std::string_view to_string(MeshAction action);  ///< refit, rebuild

/// What became of one ReplaceVertices.
struct MeshUpdateReport {
  std::uint32_t mesh_id = kInvalidId;
  MeshAction action = MeshAction::kRefit;
  std::string reason;              ///< why this action, as a sentence
  bool wants_better_tree = false;  ///< of a background: see better_tree()
  double cost_before = 0.0;        ///< surface-area cost before the update
  double cost_after = 0.0;
  double ms = 0.0;
};

/// What became of one SetPose.
struct PoseReport {
  std::vector<MeshUpdateReport> meshes;  ///< those whose vertices it changed, ascending by id
  std::size_t moved_instances = 0;
  std::size_t inactive_instances = 0;  ///< of these, squeezed to nothing
};

struct UpdateReport {
  std::vector<std::uint32_t> added_instances;  ///< ids in the order of the AddInstance edits
  std::vector<std::uint32_t> added_meshes;     ///< ids in the order of the AddMesh edits
  std::vector<MeshUpdateReport>
      meshes;  ///< in the order of the ReplaceVertices edits; edits of one mesh share a report
  std::vector<PoseReport> poses;  ///< in the order of the SetPose edits
  double ms = 0.0;
};

struct UpdateOptions {
  RebuildPlace rebuilds = RebuildPlace::kInUpdate;
};

struct UpdateResult {
  std::shared_ptr<const Scene> scene;  ///< version = the old one + 1
  UpdateReport report;
};

/// All edits in order, or none: on error `scene` is untouched and `where` starts with the edit
/// (`/edits/2/...`). Moving k of n instances costs O(k) plus the chunks they share with others. Errors:
/// kNotFound (unknown instance or mesh), kInvalidArgument (singular transform, non-finite or miscounted
/// positions, a pose that names what is not there), kUnsupported (mode kRefit on a structure that cannot).
[[nodiscard]] Result<UpdateResult> apply_update(const Scene& scene, const std::vector<SceneEdit>& edits,
                                                const UpdateOptions& options = {});

}  // namespace gridcast::scene
