#pragma once

#include "core/error.h"
#include "core/math/ray.h"
#include "core/scene/scene_data.h"

namespace gridcast::render {

/// A camera at a place: looks from `eye` to `target`; yfov is the full vertical angle in radians.
/// Errors name the field (`/eye`, `/target`, `/up`, `/yfov_rad`): not finite, eye == target, up parallel to
/// the view, yfov outside (0, pi).
[[nodiscard]] Result<scene::Camera> look_at(const Vec3d& eye, const Vec3d& target, const Vec3d& up,
                                            double yfov_rad);

/// A camera that sees all of `bounds` (from the front, a little above and to the right), for scenes without
/// one. An empty box counts as that from (-1, -1, -1) to (1, 1, 1).
[[nodiscard]] scene::Camera frame(const Bounds3d& bounds, double yfov_rad, double aspect_ratio);

/// Whether primary rays of this camera are valid: finite place without scale, field of view in (0, pi),
/// positive sizes. A file's camera may be anything.
[[nodiscard]] bool is_usable(const scene::Camera& camera);

/// Primary ray through (x, y) in pixels, (0, 0) the upper left corner of the picture, (0.5, 0.5) the centre
/// of its first pixel. Direction of unit length; znear and zfar are not applied. Pixels are square: where the
/// camera's own shape (aspect_ratio, xmag : ymag) differs from the picture's, the picture shows all that the
/// camera frames, and more along one side. `camera` is usable.
[[nodiscard]] Ray primary_ray(const scene::Camera& camera, int width_px, int height_px, double x_px,
                              double y_px);

}  // namespace gridcast::render
