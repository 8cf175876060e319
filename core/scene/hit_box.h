#pragma once

#include "core/math/affine.h"
#include "core/scene/mesh_hull.h"
#include "core/tlas/instance_box.h"

namespace gridcast::scene {

/// Where hits of an instance can lie: see tlas::InstanceBox for the promise and hit_box.cpp for the proof.
/// Empty for an inactive transform or an empty mesh. `hull` holds every triangle of the mesh.
[[nodiscard]] tlas::InstanceBox hit_box(const InstanceTransform& transform, const MeshHull& hull);

}  // namespace gridcast::scene
