#pragma once

#include <cstdint>
#include <stop_token>
#include <string>

#include "core/error.h"
#include "core/io/gltf.h"
#include "core/scene/scene.h"

namespace gridcast::io {

struct ExportOptions {
  GltfLimits limits;  ///< what is written keeps to them: import_gltf with the same limits takes it
  std::stop_token stop;
};

/// A version of a scene as one GLB (glTF 2.0) that needs nothing beside it. import_gltf and build_scene make
/// a scene of it that answers bit for bit as this one does: positions are the floats of the present pose, a
/// node's `matrix` has the doubles of its instance's world_from_object, printed so that they read back
/// exactly.
///
/// Meshes keep their ids. Living instances keep their order and are numbered without gaps: where a removed
/// one left a gap, `extras.instance_id` of a node tells what its instance was called. Written too: names,
/// materials, cameras, lights. Not written: skins, morph targets and animations, for the pose is baked; nodes
/// without an instance. A mesh without triangles becomes points, which no ray meets. A sheared instance is a
/// matrix that glTF 2.0 does not provide for, though readers take it. Errors: kLimitExceeded (the meshes are
/// too large, or the instances too many, for `limits`), kCancelled.
[[nodiscard]] Result<std::string> export_glb(const scene::Scene& scene, const ExportOptions& options = {});

/// What export_glb holds at once, in bytes, at most: for who must know before.
[[nodiscard]] std::uint64_t export_memory_bytes(const scene::Scene& scene, const GltfLimits& limits = {});

}  // namespace gridcast::io
