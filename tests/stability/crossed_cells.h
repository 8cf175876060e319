#pragma once
// The cells of a grid that a ray is in, without the walk's arithmetic.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/math/ray.h"
#include "core/tlas/grid_layout.h"
#include "tests/stability/wide_float.h"

namespace gridcast::stability {

/// The ray's origin from the grid's lower corner: with one rounding, however far away both are.
template <class Real>
Real from_lower(const tlas::GridLayout& layout, const Ray& ray, int axis) {
  return Real(ray.origin[axis]) - Real(layout.bounds.lower[axis]);
}

/// How long the ray is in a cell made smaller by `margin` on every side, in t; negative when it is not.
template <class Real>
Real chord(const tlas::GridLayout& layout, const tlas::Cell& cell, const Ray& ray, double margin) {
  Real enter = ray.tnear, exit = ray.tfar;
  for (int axis = 0; axis < 3; ++axis) {
    const auto plane = [&](int k) { return Real(cell[std::size_t(axis)] + k) * Real(layout.cell[axis]); };
    const Real o = from_lower<Real>(layout, ray, axis), d = ray.direction[axis];
    const Real low = plane(0) + Real(margin) - o, high = plane(1) - Real(margin) - o;
    if (d == 0) {
      if (low > 0 || high < 0) return -1;
      continue;
    }
    enter = std::max(enter, (d > 0 ? low : high) / d);
    exit = std::min(exit, (d > 0 ? high : low) / d);
  }
  return exit - enter;
}

/// Whether the ray is in the cell, made smaller by `margin`, for longer than `least` in t. 64 bits of
/// significand decide where their rounding, below 1e-15 here, cannot matter; 113 bits do where it can.
inline bool has_chord(const tlas::GridLayout& layout, const tlas::Cell& cell, const Ray& ray, double margin,
                      double least) {
  const auto length = chord<long double>(layout, cell, ray, margin);
  if (std::abs(length - least) > 0.1L * least) return length > least;
  return chord<WideFloat>(layout, cell, ray, margin) > WideFloat(least);
}

/// The cells that the ray is in, found from its crossings of all planes in 64 bits. One of a chord of less
/// than rounding may be taken for its neighbour.
inline std::vector<tlas::Cell> crossed_cells(const tlas::GridLayout& layout, const Ray& ray) {
  std::vector<long double> crossings = {ray.tnear, ray.tfar};
  for (int axis = 0; axis < 3; ++axis) {
    if (ray.direction[axis] == 0.0) continue;
    const auto o = from_lower<long double>(layout, ray, axis);
    for (std::uint32_t k = 0; k <= layout.cells[axis]; ++k) {
      const long double t = (static_cast<long double>(k) * layout.cell[axis] - o) / ray.direction[axis];
      if (t > ray.tnear && t < ray.tfar) crossings.push_back(t);
    }
  }
  std::sort(crossings.begin(), crossings.end());
  std::vector<tlas::Cell> cells;
  for (std::size_t i = 0; i + 1 < crossings.size(); ++i) {
    const long double middle = (crossings[i] + crossings[i + 1]) / 2;
    tlas::Cell cell{};
    bool inside = true;
    for (int axis = 0; axis < 3; ++axis) {
      const auto o = from_lower<long double>(layout, ray, axis);
      const long double index = (o + middle * ray.direction[axis]) / layout.cell[axis];
      inside = inside && index >= 0 && index < layout.cells[axis];
      if (inside) cell[std::size_t(axis)] = std::uint16_t(index);
    }
    if (inside) cells.push_back(cell);
  }
  return cells;
}

}  // namespace gridcast::stability
