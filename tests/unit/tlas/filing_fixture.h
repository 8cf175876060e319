#pragma once
// Boxes and grids for tests of filing.

#include <cmath>
#include <utility>
#include <vector>

#include "core/tlas/grid_layout.h"
#include "tests/support/random.h"

namespace gridcast::tlas {

/// Of all sizes; some are empty, some leave the grids below, some drift.
inline std::vector<InstanceBox> awkward_boxes(std::size_t count, test::Random& random) {
  std::vector<InstanceBox> boxes(count);
  for (InstanceBox& box : boxes) {
    const std::uint32_t kind = random.below(10);
    if (kind == 0) continue;                                    // empty
    const Vec3d at = random.in_box(kind == 1 ? 300.0 : 100.0);  // some leave the grid
    const Vec3d half = random.in_box(std::exp2(random.uniform(-20.0, 5.0)));
    box.bounds.extend(at - glm::abs(half));
    box.bounds.extend(at + glm::abs(half));
    box.drift = kind == 2 ? 1e-3F : float(random.uniform(0.0, 1e-12));
    if (kind == 3) box.bounds.lower.y = box.bounds.upper.y = 0.0;
    if (kind == 4) std::swap(box.bounds.lower.z, box.bounds.upper.z);  // empty along one axis alone
  }
  return boxes;
}

/// So many cells along each axis of the same box.
inline GridLayout layout_of_a_grid(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
  GridLayout layout;
  layout.bounds = {Vec3d(-120.0, -110.0, -130.0), Vec3d(125.0, 115.0, 105.0)};
  const std::uint32_t cells[3] = {x, y, z};
  for (int axis = 0; axis < 3; ++axis) {
    layout.cells[axis] = cells[axis];
    layout.cell[axis] = layout.bounds.extent()[axis] / cells[axis];
    layout.inverse_cell[axis] = cells[axis] / layout.bounds.extent()[axis];
  }
  layout.reach = 1e6;
  layout.prepare();
  return layout;
}

}  // namespace gridcast::tlas
