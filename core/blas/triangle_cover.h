#pragma once

#include <array>
#include <span>

#include "core/math/bounds.h"

namespace gridcast::blas {

/// Whether the boxes together contain the triangle, up to slivers of a billionth of its size. For validation
/// of trees in which several leaves share a triangle.
[[nodiscard]] bool covers(std::span<const Bounds3f> boxes, const std::array<Vec3f, 3>& corners);

}  // namespace gridcast::blas
