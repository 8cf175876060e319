#pragma once
// Four floats in a register, for builders: a box is two of them. Minimum, maximum and the plain operations
// give the same bits on every instruction set, so a tree does too.

#include <cstdint>
#include <limits>

#include "core/math/bounds.h"

namespace gridcast::blas {

using Float4 [[gnu::vector_size(16)]] = float;
using Int4 [[gnu::vector_size(16)]] = std::int32_t;

inline Float4 broadcast(float x) {
  return Float4{x, x, x, x};
}
inline Float4 min(Float4 a, Float4 b) {
  return a < b ? a : b;
}
inline Float4 max(Float4 a, Float4 b) {
  return a > b ? a : b;
}
/// With 0 in the fourth lane.
inline Float4 first_three(Float4 a) {
  return Float4(Int4(a) & Int4{-1, -1, -1, 0});
}

/// A box whose fourth lanes are anything. The default is empty.
struct Box4 {
  Float4 lower = broadcast(std::numeric_limits<float>::infinity());
  Float4 upper = broadcast(-std::numeric_limits<float>::infinity());

  void extend(const Box4& box) {
    lower = min(box.lower, lower);
    upper = max(box.upper, upper);
  }
  void extend(Float4 point) {
    lower = min(point, lower);
    upper = max(point, upper);
  }
  void clip(const Box4& box) {
    lower = max(box.lower, lower);
    upper = min(box.upper, upper);
  }
  [[nodiscard]] Float4 extent() const { return first_three(upper) - first_three(lower); }
  [[nodiscard]] Bounds3f bounds() const {
    return {{lower[0], lower[1], lower[2]}, {upper[0], upper[1], upper[2]}};
  }
};

inline Box4 to_box4(const Bounds3f& box) {
  return {Float4{box.lower.x, box.lower.y, box.lower.z, 0.F},
          Float4{box.upper.x, box.upper.y, box.upper.z, 0.F}};
}

/// Half the surface area of boxes inside one root, in units in which the root's longest side is about 1:
/// float squares then neither overflow nor lose what matters.
class AreaScale {
 public:
  AreaScale() = default;
  explicit AreaScale(const Bounds3f& root) {
    const float longest = root.empty() ? 0.F : max_abs(root.extent());
    constexpr float kSmallest = 0x1p-120F;
    scale_ = broadcast(1.F / std::max(longest, kSmallest));
  }
  /// Not for empty boxes.
  [[nodiscard]] float half_area(const Box4& box) const {
    const Float4 e = box.extent() * scale_;
    return e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
  }

 private:
  Float4 scale_ = broadcast(1.F);
};

}  // namespace gridcast::blas
