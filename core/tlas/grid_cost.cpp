#include "core/tlas/grid_cost.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

namespace gridcast::tlas {
namespace {

/// Rays may start this many scene extents away and still be walked. Larger would give boxes more room.
constexpr double kReachInExtents = 0x1p12;
/// Boxes and cells from which the share of the occupied space is found.
constexpr std::size_t kSamples = 2048;
constexpr double kSampleCells = 2048.0;
/// Room around the union of all boxes, in extents: boxes whose own room is larger are tested for every ray.
constexpr double kMarginInExtents = 0x1p-13;

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
  layout.prepare();
}

/// What a cell with `mean` instances on average costs a ray. Their number varies like Poisson's.
double cell_cost(double mean) {
  const double occupied = 1.0 - std::exp(-mean);
  if (mean > double(kMaxFlat))
    return kCellCost + kNodeCost * (1.0 + kNodesPerDoubling * std::log2(mean / 8.0));
  const double listed = mean / occupied;
  return occupied * (kCellCost + kGroupCost * std::max(1.0, listed / 8.0 + 0.4));
}

double half_area(const Vec3d& e) {
  return e.x * e.y + e.y * e.z + e.z * e.x;
}

struct Estimate {
  double cost;   ///< of a random ray
  double bytes;  ///< of the cells
};

/// A box is listed in its range of cells, which is on average one cell longer than the box on each axis. The
/// instances are taken to lie in a share of the space (BoxSums::share), evenly there. Each box that a ray
/// meets ends it with the same probability;
/// and one cell more is looked at than by a random ray, since rays go where the instances are.
Estimate estimate(const GridLayout& layout, const BoxSums& sums) {
  const Vec3d& c = layout.cell;
  const Vec3d in_cells = sums.extent / c;
  const double references = sums.count + in_cells.x + in_cells.y + in_cells.z + sums.faces.x / (c.y * c.z) +
                            sums.faces.y / (c.z * c.x) + sums.faces.z / (c.x * c.y) +
                            sums.volume / (c.x * c.y * c.z);
  const auto cells = double(layout.cell_count());
  const double in_use = std::max(cells * sums.share, 1.0), mean = references / in_use;
  const double occupied = in_use * (1.0 - std::exp(-mean));
  const double grid_area = half_area(layout.bounds.extent());
  const double met = kStopsRay * (sums.faces.x + sums.faces.y + sums.faces.z) / grid_area;
  const double gone = met > 1e-3 ? (1.0 - std::exp(-met)) / met : 1.0;
  const double steps = std::max(1.0, gone * cells * half_area(c) / grid_area);
  const double cell = cell_cost(mean);
  return {kWalkCost + cell + steps * (kStepCost + in_use / cells * cell),
          std::max(128.0 * occupied, 64.0 * occupied + 33.0 * references)};
}

/// Bounds and reach of the grid over all boxes; one cell.
GridLayout frame(const Bounds3d& bounds) {
  GridLayout layout;
  layout.bounds = bounds;
  const double extent = max_abs(layout.bounds.extent());
  const double magnitude = layout.bounds.magnitude();
  // At least the distance to the world's origin, where cameras of far-off scenes often are.
  layout.reach = std::max(kReachInExtents * extent, 4.0 * magnitude);
  const double margin = kMarginInExtents * extent + 4.0 * rounding_slack(layout.reach, layout.bounds);
  layout.bounds.lower -= Vec3d(margin);
  layout.bounds.upper += Vec3d(margin);
  return layout;
}

/// The same cells, but larger, so that there is room on each side.
void widen(GridLayout& layout, const Vec3d& room) {
  layout.bounds.lower -= room;
  layout.bounds.upper += room;
  for (int axis = 0; axis < 3; ++axis) {
    layout.cell[axis] = layout.bounds.extent()[axis] / double(layout.cells[axis]);
    layout.inverse_cell[axis] = double(layout.cells[axis]) / layout.bounds.extent()[axis];
  }
  layout.prepare();
}

/// See BoxSums::share: the occupied cells of a coarse grid over some of the boxes, as a part of those that as
/// many boxes spread at random would occupy.
double occupied_share(const BoxSums& sums, const BoxTable& boxes) {
  if (sums.count < 2.0) return 1.0;
  GridLayout coarse = frame(sums.bounds);
  set_cells(coarse, kSampleCells);
  const std::size_t stride = (boxes.size() + kSamples - 1) / kSamples;
  std::vector<std::uint8_t> occupied(coarse.cell_count(), 0);
  double samples = 0.0, found = 0.0;
  for (std::size_t i = 0; i < boxes.size(); i += stride) {
    const Bounds3d& box = boxes[i].bounds;
    if (box.empty()) continue;
    const Vec3d at = box.center();
    const std::size_t x = coarse.cell_of(0, at.x), y = coarse.cell_of(1, at.y), z = coarse.cell_of(2, at.z);
    std::uint8_t& cell = occupied[(z * coarse.cells[1] + y) * coarse.cells[0] + x];
    found += cell == 0 ? 1.0 : 0.0;
    cell = 1;
    samples += 1.0;
  }
  const auto cells = double(coarse.cell_count());
  return samples == 0.0 ? 1.0 : std::min(1.0, found / (cells * (1.0 - std::exp(-samples / cells))));
}

std::string describe(const char* format, double a, double b) {
  char text[160];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

}  // namespace

void BoxSums::add(const InstanceBox& box) {
  if (box.bounds.empty()) return;
  const Vec3d e = box.bounds.extent();
  bounds.extend(box.bounds);
  count += 1.0;
  extent += e;
  faces += Vec3d(e.y * e.z, e.z * e.x, e.x * e.y);
  volume += e.x * e.y * e.z;
}

void BoxSums::add(const BoxSums& other) {
  bounds.extend(other.bounds);
  count += other.count;
  extent += other.extent;
  faces += other.faces;
  volume += other.volume;
}

namespace {

/// Calls visit(box) for some of the boxes in a row. Those of the next chunk are asked for while one is read,
/// since chunks may lie anywhere.
template <class Visit>
void for_each_box(const BoxTable& boxes, std::size_t begin, std::size_t end, const Visit& visit) {
  constexpr std::size_t kChunk = BoxTable::kChunkSize;
  for (std::size_t i = begin; i < end;) {
    const std::size_t first = i / kChunk * kChunk, last = std::min(first + kChunk, end);
    const InstanceBox* const chunk = boxes.chunk(first).data();
    const InstanceBox* const next = last < end ? boxes.chunk(last).data() : chunk;
    for (; i < last; ++i) {
      __builtin_prefetch(&next[i - first]);
      visit(chunk[i - first]);
    }
  }
}

}  // namespace

BoxSums sum_boxes(const BoxTable& boxes) {
  using Range = tbb::blocked_range<std::size_t>;
  BoxSums all = tbb::parallel_deterministic_reduce(
      Range(0, boxes.size(), 8192), BoxSums(),
      [&](const Range& range, BoxSums sums) {
        for_each_box(boxes, range.begin(), range.end(), [&](const InstanceBox& box) { sums.add(box); });
        return sums;
      },
      [](BoxSums a, const BoxSums& b) {
        a.add(b);
        return a;
      });
  all.share = occupied_share(all, boxes);
  return all;
}

Bounds3d bounds_of(const BoxTable& boxes) {
  using Range = tbb::blocked_range<std::size_t>;
  return tbb::parallel_reduce(
      Range(0, boxes.size(), 8192), Bounds3d(),
      [&](const Range& range, Bounds3d bounds) {
        // An empty box changes nothing.
        for_each_box(boxes, range.begin(), range.end(),
                     [&](const InstanceBox& box) { bounds.extend(box.bounds); });
        return bounds;
      },
      [](Bounds3d a, const Bounds3d& b) {
        a.extend(b);
        return a;
      });
}

GridChoice choose_grid(const BoxSums& sums, std::uint64_t most_cells, double room) {
  if (sums.count == 0.0) return {std::nullopt, "There is nothing to hit."};
  if (sums.count == 1.0) return {std::nullopt, "One instance needs no grid."};
  GridLayout layout = frame(sums.bounds);
  const auto instances = std::uint64_t(sums.count);
  most_cells = std::min(most_cells, max_cells(instances));
  set_cells(layout, 1.0);
  GridLayout best = layout;
  const double one_cost = estimate(layout, sums).cost;
  double best_cost = one_cost;
  for (double cells = double(most_cells); cells >= 2.0; cells *= 0.75) {
    set_cells(layout, cells);
    if (layout.cell_count() > most_cells || layout.cell_count() < 2) continue;
    const Estimate expected = estimate(layout, sums);
    if (expected.cost >= best_cost || expected.bytes > double(max_bytes(instances))) continue;
    best_cost = expected.cost;
    best = layout;
  }
  // Afterwards, so that a flat grid stays flat.
  if (room > 0.0) widen(best, room / sums.count * sums.extent);
  if (best.cell_count() == 1) {
    return {best,
            describe("No grid is expected to be faster than the boxes of all %.0f instances side by side "
                     "(cost %.0f a ray).",
                     sums.count, one_cost)};
  }
  return {best,
          describe("The cheapest of the resolutions tried: cost %.0f a ray, against %.0f without cells.",
                   best_cost, one_cost)};
}

}  // namespace gridcast::tlas
