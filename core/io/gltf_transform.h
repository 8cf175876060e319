#pragma once

#include "core/io/gltf_model.h"
#include "core/math/trs.h"

namespace gridcast::io {

/// From 16 numbers, column-major; the bottom row is not looked at.
[[nodiscard]] Affine affine_from_matrix(const double* matrix);

/// The same place and direction without scale, shear and mirroring: -z and +y stay, x is made to fit; a
/// rotation stays bit for bit. The identity rotation when there is no direction left.
[[nodiscard]] Affine rigid_part(const Affine& affine);

}  // namespace gridcast::io
