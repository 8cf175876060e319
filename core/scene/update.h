#pragma once

#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/scene/scene.h"

namespace gridcast::scene {

struct AddInstance {
  std::uint32_t mesh_id = kInvalidId;
  Affine world_from_object;
  std::string name;
};
struct RemoveInstance {
  std::uint32_t instance_id = kInvalidId;
};
struct MoveInstance {
  std::uint32_t instance_id = kInvalidId;
  Affine world_from_object;
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

using SceneEdit = std::variant<AddInstance, RemoveInstance, MoveInstance, ReplaceVertices, AddMesh>;

enum class MeshAction : std::uint8_t { kRefit, kRebuild };
[[nodiscard]] std::string_view to_string(MeshAction action);  ///< refit, rebuild

/// What became of one ReplaceVertices.
struct MeshUpdateReport {
  std::uint32_t mesh_id = kInvalidId;
  MeshAction action = MeshAction::kRefit;
  std::string reason;        ///< why this action, as a sentence
  double cost_before = 0.0;  ///< surface-area cost before the update
  double cost_after = 0.0;
  double ms = 0.0;
};

struct UpdateReport {
  std::vector<std::uint32_t> added_instances;  ///< ids in the order of the AddInstance edits
  std::vector<std::uint32_t> added_meshes;     ///< ids in the order of the AddMesh edits
  std::vector<MeshUpdateReport>
      meshes;  ///< in the order of the ReplaceVertices edits; edits of one mesh share a report
  double ms = 0.0;
};

struct UpdateResult {
  std::shared_ptr<const Scene> scene;  ///< version = the old one + 1
  UpdateReport report;
};

/// kAuto rebuilds when the refitted tree's surface-area cost exceeds this times its cost at build.
/// numerics.md's watch rule after C. Lauterbach, 2006.
inline constexpr double kMaxRefitCostRatio = 1.5;

/// All edits in order, or none: on error `scene` is untouched and `where` starts with the edit
/// (`/edits/2/...`). Moving k of n instances costs O(k) plus the chunks they share with others. Errors:
/// kNotFound (unknown instance or mesh), kInvalidArgument (singular transform, non-finite or miscounted
/// positions), kUnsupported (mode kRefit on a structure that cannot).
[[nodiscard]] Result<UpdateResult> apply_update(const Scene& scene, const std::vector<SceneEdit>& edits);

}  // namespace gridcast::scene
