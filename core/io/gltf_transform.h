#pragma once

#include <array>

#include "core/io/gltf_model.h"
#include "core/math/affine.h"

namespace gridcast::io {

/// parent_from_node of translation, rotation (x, y, z, w; normalised here, none when zero) and scale.
[[nodiscard]] Affine affine_from_trs(const Vec3d& translation, const std::array<double, 4>& rotation,
                                     const Vec3d& scale);
/// From 16 numbers, column-major; the bottom row is not looked at.
[[nodiscard]] Affine affine_from_matrix(const double* matrix);
[[nodiscard]] bool is_finite(const Affine& affine);

/// The same place and direction without scale, shear and mirroring: -z and +y stay, x is made to fit. The
/// identity rotation when there is no direction left.
[[nodiscard]] Affine rigid_part(const Affine& affine);

}  // namespace gridcast::io
