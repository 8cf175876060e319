#pragma once

#include <array>

#include "core/math/affine.h"

namespace gridcast {

/// Translation, rotation and scale as glTF's nodes have them: p -> translation + rotate(scale * p).
struct Trs {
  Vec3d translation{0.0};
  std::array<double, 4> rotation{0.0, 0.0, 0.0, 1.0};  ///< quaternion x, y, z, w of any length
  Vec3d scale{1.0};
  friend bool operator==(const Trs&, const Trs&) = default;
};

/// Scaled to unit length; the identity when it has none.
[[nodiscard]] std::array<double, 4> normalized_rotation(const std::array<double, 4>& rotation);

/// parent_from_node of a Trs.
[[nodiscard]] Affine affine_from_trs(const Trs& trs);

/// The Trs that makes `affine`, or the closest of that form when it has shear: scale is the length of the
/// columns, negative along x when the matrix mirrors.
[[nodiscard]] Trs trs_from_affine(const Affine& affine);

[[nodiscard]] bool is_finite(const Affine& affine);

}  // namespace gridcast
