#pragma once

#include <vector>

#include "core/scene/mesh_edits.h"
#include "core/scene/scene_editor.h"
#include "core/scene/update.h"

namespace gridcast::scene {

/// The SetPose edits of one update.
class PoseEdits {
 public:
  /// Gives the scene in `editor` its new pose and moves its instances, whose ids are added to `touched`; new
  /// vertices go to `meshes`, which has checked them. Errors carry a pointer relative to the edit.
  [[nodiscard]] Status apply(const SetPose& edit, std::size_t edit_index, SceneEditor& editor,
                             MeshEdits& meshes, std::vector<std::uint32_t>& touched);

  /// In the order of the edits; after MeshEdits::apply().
  [[nodiscard]] std::vector<PoseReport> reports(const MeshEdits& meshes) const;

 private:
  struct Applied {
    PoseReport report;
    std::vector<std::uint32_t> meshes;  ///< that changed
  };
  std::vector<Applied> applied_;
};

}  // namespace gridcast::scene
