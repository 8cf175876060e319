#pragma once

#include "core/scene/scene.h"

namespace gridcast::measure {

/// The geometry of this version of a scene as plain data: meshes bent as they are now, instances where they
/// stand, with the same ids. A removed instance keeps its number with a transform of zeros, which is never
/// hit. Nodes, skins and animations are left out: building it gives the same answers, and nothing moves.
[[nodiscard]] scene::SceneData snapshot_of(const scene::Scene& scene);

}  // namespace gridcast::measure
