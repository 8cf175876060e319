#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "core/math/bounds.h"
#include "core/math/chunked_vector.h"

namespace gridcast::tlas {

/// What the top level knows of an instance. A hit of it lies in `bounds` grown by drift * D on every side,
/// where D is at least the distance (largest component) from the ray's origin to any point of `bounds`:
/// the rounding of the world-to-object transform, which grows with the distance. Empty bounds: never hit.
struct InstanceBox {
  Bounds3d bounds;
  float drift = 0.F;
  friend bool operator==(const InstanceBox&, const InstanceBox&) = default;
};

using Cell = std::array<std::uint16_t, 3>;

/// A box of cells, both ends included; the default is empty.
struct CellRange {
  Cell lower{1, 1, 1};
  Cell upper{0, 0, 0};

  [[nodiscard]] bool empty() const { return lower[0] > upper[0]; }
  [[nodiscard]] bool contains(const Cell& cell) const {
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (cell[axis] < lower[axis] || cell[axis] > upper[axis]) return false;
    return true;
  }
  /// Calls visit(cell) for every cell, x fastest.
  template <class Visit>
  void for_each(const Visit& visit) const {
    if (empty()) return;
    for (std::uint32_t z = lower[2]; z <= upper[2]; ++z)
      for (std::uint32_t y = lower[1]; y <= upper[1]; ++y)
        for (std::uint32_t x = lower[0]; x <= upper[0]; ++x)
          visit(Cell{std::uint16_t(x), std::uint16_t(y), std::uint16_t(z)});
  }
  [[nodiscard]] std::uint64_t cell_count() const {
    if (empty()) return 0;
    std::uint64_t count = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) count *= std::uint64_t(upper[axis] - lower[axis]) + 1;
    return count;
  }
  /// The part that is also in `clip`; both are not empty and overlap.
  [[nodiscard]] CellRange intersection(const CellRange& clip) const {
    CellRange both;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      both.lower[axis] = std::max(lower[axis], clip.lower[axis]);
      both.upper[axis] = std::min(upper[axis], clip.upper[axis]);
    }
    return both;
  }
  friend bool operator==(const CellRange&, const CellRange&) = default;
};

/// The boxes of all instances, by id. Chunks are small, since one that moves costs a copy of its chunk.
using BoxTable = ChunkedVector<InstanceBox, 64>;

}  // namespace gridcast::tlas
