#pragma once

#include "core/scene/pose.h"
#include "core/scene/update.h"

namespace gridcast::scene {

/// The pose that an edit asks for. Errors carry a pointer relative to the edit: names and numbers that are
/// not in the file or given twice (`/nodes/2/node`), wrong counts (`/skins/0/joint_matrices`), numbers that
/// are not finite, singular matrices (`/skins/0/joint_matrices/3`), nodes that leave the range of double.
[[nodiscard]] Result<Pose> next_pose(const SceneData& data, const Rig& rig, const Pose& present,
                                     const SetPose& edit);

}  // namespace gridcast::scene
