#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "core/tlas/grid_layout.h"

namespace gridcast::tlas {

// The cost model, in units of one cell step of the walk (about 5 ns). It counts what a random line that meets
// the grid does when nothing stops it early; a convex body of surface area S inside one of area G is met
// with probability S / G (Cauchy, Crofton).
inline constexpr double kStepCost = 1.0;
inline constexpr double kBoxTestCost = 1.5;  ///< fetching an entry and testing its box
inline constexpr double kWalkSetupCost = 10.0;

// Memory bounds of a grid over N instances.
inline constexpr std::uint64_t kCellsPerInstance = 8;
inline constexpr std::uint64_t kReferencesPerInstance = 12;
inline constexpr std::uint64_t kFreeCells = 512;  ///< allowed on top, cells and references alike

inline std::uint64_t max_cells(std::uint64_t instances) {
  return kCellsPerInstance * instances + kFreeCells;
}
inline std::uint64_t max_references(std::uint64_t instances) {
  return kReferencesPerInstance * instances + kFreeCells;
}

struct GridChoice {
  std::optional<GridLayout> layout;  ///< none: test every box
  std::string reason;                ///< as a sentence
};

/// The cheapest resolution by the cost model within the memory bounds, or none where testing every box is
/// cheaper. Empty boxes do not count.
[[nodiscard]] GridChoice choose_grid(std::span<const InstanceBox> boxes);

}  // namespace gridcast::tlas
