#pragma once

#include "core/scene/scene.h"

namespace gridcast::scene {

/// What a version looks like, as data without nodes, skins and animations: its meshes as they are bent now
/// and its instances where they are now, under the same ids (removed ones have a transform without size).
/// build_scene makes a scene of it that gives the same answers to queries that see all. Shares the meshes;
/// masks are left out.
[[nodiscard]] SceneData flattened(const Scene& scene);

/// Whether the meshes of `data` are what its rest pose shows: none is skinned or has morph weights. Who reads
/// them as they are asks this first, or takes flattened() data.
[[nodiscard]] bool is_flat(const SceneData& data);

}  // namespace gridcast::scene
