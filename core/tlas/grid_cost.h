#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/tlas/box_group.h"
#include "core/tlas/grid_layout.h"

namespace gridcast::tlas {

// The cost model, in units of about a nanosecond; only ratios matter. The constants are estimates: adjusted
// until the lattice, the forest and the stadium got the resolutions that a sweep found good, not measured one
// by one. It counts what a random line that meets the grid does when nothing stops it early; a convex body of
// surface area S inside one of area G is met with probability S / G (Cauchy, Crofton).
inline constexpr double kWalkCost = 40.0;  ///< setting up the walk
inline constexpr double kStepCost = 4.0;   ///< a cell
inline constexpr double kCellCost = 5.0;   ///< reading an occupied cell
inline constexpr double kGroupCost = 6.0;  ///< testing four or eight boxes
inline constexpr double kNodeCost = 9.0;   ///< the same with a stack, in a tree
/// Nodes and leaves of a crowded cell's tree that a ray looks at, for each doubling of its instances above 8.
inline constexpr double kNodesPerDoubling = 1.6;
/// How often a box that a ray meets holds something that stops it.
inline constexpr double kStopsRay = 0.5;

// Memory bounds of a grid over N instances, beside their boxes.
inline constexpr std::uint64_t kBytesPerInstance = 136;
inline constexpr std::uint64_t kFreeBytes = 65536;  ///< allowed on top
inline constexpr std::uint64_t kCellsPerInstance = 16;
inline constexpr std::uint64_t kFreeCells = 512;

inline std::uint64_t max_cells(std::uint64_t instances) {
  return kCellsPerInstance * instances + kFreeCells;
}
inline std::uint64_t max_bytes(std::uint64_t instances) {
  return kBytesPerInstance * instances + kFreeBytes;
}

/// What is known of all boxes together; the cost of any resolution follows from it.
struct BoxSums {
  Bounds3d bounds;
  double count = 0.0;   ///< of boxes that are not empty
  Vec3d extent{0.0};    ///< sum of e
  Vec3d faces{0.0};     ///< sum of (ey ez, ez ex, ex ey)
  double volume = 0.0;  ///< sum of ex ey ez
  /// How much of the space is in use, against boxes spread at random: about 1 for a forest, near 0 where all
  /// but a few are in one place.
  double share = 1.0;

  void add(const InstanceBox& box);
  void add(const BoxSums& other);
};
/// Parallel; the same whatever the number of threads.
[[nodiscard]] BoxSums sum_boxes(const BoxTable& boxes);
/// BoxSums::bounds alone, in half of the time.
[[nodiscard]] Bounds3d bounds_of(const BoxTable& boxes);

struct GridChoice {
  std::optional<GridLayout> layout;  ///< none: test every box by itself
  std::string reason;                ///< as a sentence
};

/// The cheapest resolution by the cost model within the memory bounds and of at most `most_cells` cells; one
/// cell where a grid does not pay, none for a single instance. On each side of the boxes there is room for
/// `room` of the mean box.
[[nodiscard]] GridChoice choose_grid(const BoxSums& sums, std::uint64_t most_cells, double room = 0.0);

/// Room for instances that move on, as choose_grid() takes it.
inline constexpr double kRoomToMove = 0.5;

}  // namespace gridcast::tlas
