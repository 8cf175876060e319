#include "core/blas/compact_node.h"

#include <algorithm>
#include <cmath>

namespace gridcast::blas {
namespace {

constexpr std::uint32_t kLargest = 255;

float decoded(float origin, float step, std::uint32_t q) {
  return origin + float(q) * step;
}

/// The biased exponent of the smallest step that reaches from `origin` to `upper`.
std::uint8_t exponent_for(float origin, float upper) {
  int exponent = 0;
  const double least = (double(upper) - double(origin)) / double(kLargest);
  const double mantissa = std::frexp(least, &exponent);  // in [0.5, 1), or 0
  int biased = std::max(1, exponent + 127 - (mantissa == 0.5 ? 1 : 0));
  const auto step = [&] { return std::bit_cast<float>(std::uint32_t(biased) << 23U); };
  if (!(least > 0.0)) return 1;
  while (decoded(origin, step(), kLargest) < upper) ++biased;
  return std::uint8_t(biased);
}

/// The last step that lies at or below `plane`, the first at or above.
std::uint8_t round_down(float plane, float origin, float step) {
  const double steps = (double(plane) - double(origin)) / double(step);
  auto q = std::uint32_t(std::min(steps, double(kLargest)));
  while (q > 0 && decoded(origin, step, q) > plane) --q;
  return std::uint8_t(q);
}
std::uint8_t round_up(float plane, float origin, float step) {
  const double steps = (double(plane) - double(origin)) / double(step);
  auto q = std::uint32_t(std::min(std::ceil(steps), double(kLargest)));
  while (q < kLargest && decoded(origin, step, q) < plane) ++q;
  return std::uint8_t(q);
}

}  // namespace

void CompactNode::set_boxes(std::span<const Bounds3f> boxes) {
  Bounds3f all;
  for (const Bounds3f& box : boxes) all.extend(box);
  for (int axis = 0; axis < 3; ++axis) {
    origin[axis] = all.lower[axis] + 0.F;
    exponents[axis] = exponent_for(origin[axis], all.upper[axis]);
    for (std::size_t slot = 0; slot < 8; ++slot) {
      const bool used = slot < boxes.size();
      planes[0][axis][slot] = used ? round_down(boxes[slot].lower[axis], origin[axis], step(axis)) : 0;
      planes[1][axis][slot] = used ? round_up(boxes[slot].upper[axis], origin[axis], step(axis)) : 0;
    }
  }
}

}  // namespace gridcast::blas
