#pragma once

#include <array>

#include "core/math/affine.h"
#include "core/math/hit.h"
#include "core/math/ray.h"

namespace gridcast::scene {

/// The t at which a ray meets the plane of a triangle of an instance, in the real-number problem that the
/// stored numbers pose, within 2^-52 of itself and nearly always the double nearest to it. `hit` holds t, u
/// and v near the true ones; the triangle has an area and the ray does not run along its plane.
[[nodiscard]] double exact_t(const Ray& ray, const Affine& world_from_object,
                             const std::array<Vec3f, 3>& corners, const Hit& hit);

}  // namespace gridcast::scene
