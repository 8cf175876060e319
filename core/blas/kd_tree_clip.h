#pragma once

#include <array>
#include <optional>

#include "core/math/bounds.h"

namespace gridcast::blas {

/// A box that contains the exact intersection of the triangle and the closed box `cell`, tight up to rounding
/// and never larger than the triangle's own box or `cell`. None only when the exact intersection is empty.
[[nodiscard]] std::optional<Bounds3f> clip_triangle(const std::array<Vec3f, 3>& corners,
                                                    const Bounds3f& cell);

/// A point of the triangle inside `cell`, well away from its sides: the mean corner of their intersection.
/// None when the two only touch, up to rounding. For validation: a proof that they overlap.
[[nodiscard]] std::optional<Vec3d> inner_point(const std::array<Vec3f, 3>& corners, const Bounds3f& cell);

}  // namespace gridcast::blas
