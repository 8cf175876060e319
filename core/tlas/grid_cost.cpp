#include "core/tlas/grid_cost.h"

#include <cmath>
#include <cstdio>
#include <functional>

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

namespace gridcast::tlas {
namespace {

/// Rays may start this many scene extents away and still be walked. Larger would give boxes more room.
constexpr double kReachInExtents = 0x1p12;
/// Room around the union of all boxes, in extents: boxes whose own room is larger are tested for every ray.
constexpr double kMarginInExtents = 0x1p-13;

/// Sums over the boxes, in extents of the grid, from which the cost of any resolution follows.
struct BoxSums {
  double count = 0.0;
  Vec3d extent{0.0};  // sum of e
  Vec3d faces{0.0};   // sum of (ey ez, ez ex, ex ey)
};

BoxSums sum_boxes(std::span<const InstanceBox> boxes, const Vec3d& grid_extent) {
  BoxSums sums;
  for (const InstanceBox& box : boxes) {
    if (box.bounds.empty()) continue;
    const Vec3d e = box.bounds.extent() / grid_extent;
    sums.count += 1.0;
    sums.extent += e;
    sums.faces += Vec3d(e.y * e.z, e.z * e.x, e.x * e.y);
  }
  return sums;
}

/// Cells along each axis so that cells are about cubes and about `target` in number. An axis shorter than a
/// cell gets one, and the others share the target among them.
void set_cells(GridLayout& layout, double target) {
  const Vec3d extent = layout.bounds.extent();
  bool flat[3] = {false, false, false};
  double size = 0.0;
  for (int round = 0; round < 3; ++round) {
    double volume = 1.0;
    int axes = 0;
    for (int axis = 0; axis < 3; ++axis) {
      if (flat[axis]) continue;
      volume *= extent[axis];
      ++axes;
    }
    if (axes == 0) break;
    size = std::pow(volume / target, 1.0 / axes);
    for (int axis = 0; axis < 3; ++axis) flat[axis] = flat[axis] || extent[axis] < size;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double wanted = flat[axis] ? 1.0 : std::floor(extent[axis] / size);
    const double count = std::clamp(wanted, 1.0, double(kMaxCellsPerAxis));
    layout.cells[axis] = std::uint32_t(count);
    layout.cell[axis] = extent[axis] / count;
    layout.inverse_cell[axis] = count / extent[axis];
  }
}

/// Expected cost of a random ray through the grid. An instance is tested when the ray meets its range of
/// cells, which is on average one cell longer than its box on each axis.
double grid_cost(const GridLayout& layout, const BoxSums& sums) {
  // Everything in extents of the grid, whose faces then weigh as their true areas.
  const Vec3d extent = layout.bounds.extent() / max_abs(layout.bounds.extent());
  const Vec3d face_area{extent.y * extent.z, extent.z * extent.x, extent.x * extent.y};
  const double grid_area = face_area.x + face_area.y + face_area.z;
  const Vec3d c{1.0 / layout.cells[0], 1.0 / layout.cells[1], 1.0 / layout.cells[2]};

  double cell_area = 0.0, range_area = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    cell_area += face_area[axis] * c[a] * c[b];
    const double mean_faces =
        sums.faces[axis] + c[a] * sums.extent[b] + c[b] * sums.extent[a] + sums.count * c[a] * c[b];
    // No range is larger than the grid.
    range_area += face_area[axis] * std::min(mean_faces, sums.count);
  }
  const double steps = double(layout.cell_count()) * cell_area / grid_area;
  const double tests = range_area / grid_area;
  return kWalkSetupCost + kStepCost * steps + kBoxTestCost * tests;
}

std::uint64_t count_references(const GridLayout& layout, std::span<const InstanceBox> boxes) {
  using Range = tbb::blocked_range<std::size_t>;
  return tbb::parallel_reduce(
      Range(0, boxes.size(), 8192), std::uint64_t(0),
      [&](const Range& range, std::uint64_t sum) {
        for (std::size_t i = range.begin(); i < range.end(); ++i)
          sum += layout.range_of(boxes[i]).cell_count();
        return sum;
      },
      std::plus<>());
}

/// Bounds and reach of the grid over all boxes; one cell.
GridLayout frame(std::span<const InstanceBox> boxes) {
  GridLayout layout;
  for (const InstanceBox& box : boxes) layout.bounds.extend(box.bounds);
  const double extent = max_abs(layout.bounds.extent());
  const double magnitude = layout.bounds.magnitude();
  // At least the distance to the world's origin, where cameras of far-off scenes often are.
  layout.reach = std::max(kReachInExtents * extent, 4.0 * magnitude);
  const double margin = kMarginInExtents * extent + 4.0 * rounding_slack(layout.reach, layout.bounds);
  layout.bounds.lower -= Vec3d(margin);
  layout.bounds.upper += Vec3d(margin);
  return layout;
}

std::string describe(const char* format, double a, double b) {
  char text[160];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

}  // namespace

GridChoice choose_grid(std::span<const InstanceBox> boxes) {
  GridLayout layout = frame(boxes);
  if (layout.bounds.empty()) return {std::nullopt, "There is nothing to hit."};
  const BoxSums sums = sum_boxes(boxes, layout.bounds.extent());
  if (sums.count == 1.0) return {std::nullopt, "One instance needs no grid."};

  const auto instances = std::uint64_t(sums.count);
  const double none_cost = kBoxTestCost * sums.count;
  double best_cost = none_cost;
  std::optional<GridLayout> best;
  double cells = double(max_cells(instances));
  for (; cells >= 2.0; cells *= 0.5) {
    set_cells(layout, cells);
    if (layout.cell_count() > max_cells(instances) || layout.cell_count() < 2) continue;
    const double cost = grid_cost(layout, sums);
    if (cost >= best_cost || count_references(layout, boxes) > max_references(instances)) continue;
    best_cost = cost;
    best = layout;
  }
  if (!best) {
    return {std::nullopt, describe("Testing all %.0f boxes (cost %.1f a ray) is not dearer than any grid.",
                                   sums.count, none_cost)};
  }
  return {best,
          describe("Cheapest of the resolutions tried: cost %.1f a ray, against %.1f for testing every box.",
                   best_cost, none_cost)};
}

}  // namespace gridcast::tlas
