#pragma once
// Poses between the wire and the engine.

#include <string>
#include <vector>

#include "core/scene/update.h"
#include "proto/pose_reply.h"
#include "proto/pose_request.h"

namespace gridcast::server {

[[nodiscard]] scene::SetPose pose_edit(proto::PoseRequest request);
/// Its inverse.
[[nodiscard]] proto::PoseRequest pose_request(const scene::SetPose& edit);

[[nodiscard]] proto::PosedMesh posed_mesh(const scene::MeshUpdateReport& report);
[[nodiscard]] std::vector<proto::PosedMesh> posed_meshes(const std::vector<scene::MeshUpdateReport>& reports);
/// One that a pose left as it is.
[[nodiscard]] proto::PosedMesh unchanged_mesh(const scene::Scene& scene, std::uint32_t mesh_id);

/// A page of the nodes of the scene's pose, and the rest of it.
[[nodiscard]] proto::PoseInfo pose_info(const scene::Scene& scene, std::size_t offset, std::size_t limit);
[[nodiscard]] std::optional<proto::PlayedAnimation> played_animation(const scene::Scene& scene);

}  // namespace gridcast::server
