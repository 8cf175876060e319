#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/tlas/box_record.h"

namespace gridcast::tlas {

/// Makes the records of boxes in a grid, many at once: GridLayout::range_of and local_box bit for bit.
class BoxFiling {
 public:
  explicit BoxFiling(const GridLayout& layout);

  /// records[k] is that of the instance ids[k]. The box of one with an empty range means nothing.
  void make_records(const BoxTable& boxes, std::span<const std::uint32_t> ids, BoxRecord* records) const;

  /// The layout by planes, in the order of a box's memory: lower x, y, z, upper x, y, z, and two that mean
  /// nothing.
  struct Planes {
    alignas(64) double outward[8] = {};  ///< -1 or 1; 0 beyond the six
    double border[8] = {}, origin[8] = {}, inverse_cell[8] = {}, last_cell[8] = {};
    double center[8] = {}, rounding[8] = {};
    double reach = 0.0, slack = 0.0;  ///< see GridLayout::pad
  };

 private:
  Planes planes_;
};

}  // namespace gridcast::tlas
