#pragma once

#include <map>
#include <optional>
#include <vector>

#include "core/mesh/deform.h"
#include "core/scene/scene_editor.h"
#include "core/scene/update.h"

namespace gridcast::scene {

/// The ReplaceVertices edits of one update. Edits of the same mesh compose: their positions are written one
/// after the other, then the structure is refitted or rebuilt once, and their reports are the same.
class MeshEdits {
 public:
  explicit MeshEdits(RebuildPlace rebuilds) : rebuilds_(rebuilds) {}

  /// Checks an edit and remembers its positions; `edit_index` is its place in the update. Errors carry a
  /// pointer relative to the edit (`/positions/17`).
  [[nodiscard]] Status add(const Scene& scene, const ReplaceVertices& edit, std::size_t edit_index);

  /// The vertices that a pose, edit `edit_index`, gives a mesh of the scene, in place of what came before;
  /// normals empty for a mesh without. The error is that of mesh::validate_positions.
  [[nodiscard]] Status pose(std::uint32_t mesh_id, mesh::DeformedVertices vertices, UpdateMode mode,
                            std::size_t edit_index);

  /// Refits or rebuilds every edited mesh in `editor`, in parallel: many small meshes share the threads, and
  /// so do the triangles of a large one. Errors carry the whole pointer (`/edits/2/mode`); of several the one
  /// of the smallest mesh id.
  [[nodiscard]] Status apply(SceneEditor& editor);

  /// In the order of the edits; after apply().
  [[nodiscard]] std::vector<MeshUpdateReport> reports() const;
  /// Of one edited mesh, after apply().
  [[nodiscard]] const MeshUpdateReport& report(std::uint32_t mesh_id) const {
    return pending_.at(mesh_id).report;
  }
  /// Whether an edit named this mesh.
  [[nodiscard]] bool edited(std::uint32_t mesh_id) const { return pending_.contains(mesh_id); }
  [[nodiscard]] bool empty() const { return pending_.empty(); }

 private:
  struct Pending {
    std::vector<Vec3f> positions;
    std::vector<Vec3f> normals;  ///< that came with the positions; empty = made from them
    std::optional<std::vector<std::uint32_t>> vertices;  ///< that may differ; none = any
    std::uint32_t edit_count = 0;
    std::size_t last_refit_edit = 0;  ///< the last edit of mode kRefit, for its error
    UpdateMode mode = UpdateMode::kAuto;
    MeshUpdateReport report;
  };

  Status apply(SceneEditor& editor, std::uint32_t mesh_id, Pending& pending) const;

  RebuildPlace rebuilds_;
  std::map<std::uint32_t, Pending> pending_;  // by mesh_id
  std::vector<std::uint32_t> mesh_of_edit_;
};

}  // namespace gridcast::scene
