#pragma once

#include <algorithm>
#include <cstdint>

#include "core/tlas/instance_box.h"
#include "core/tlas/world_ray.h"

namespace gridcast::tlas {

/// Most cells along an axis: indices fit 16 bits.
inline constexpr std::uint32_t kMaxCellsPerAxis = 65535;

/// log2 of the most cells in a block: one bit each in a 64-bit word.
inline constexpr std::uint32_t kBlockBits = 6;

/// Where the cells of a grid are: plane k of an axis is at lower + k * cell. Cells are in blocks of up to 64
/// (4 x 4 x 4, or as flat as the grid).
struct GridLayout {
  Bounds3d bounds;
  Vec3d center{0.0};  ///< of the bounds: what boxes in floats are relative to
  Vec3d cell{1.0};    ///< size of a cell in metres
  Vec3d inverse_cell{1.0};
  std::uint32_t cells[3] = {1, 1, 1};
  /// Rays that start farther than this from some point of the bounds are not walked: boxes are filed with
  /// room for the drift over this distance only.
  double reach = 0.0;
  std::uint32_t shift[3] = {0, 0, 0};   ///< log2 of a block's cells along each axis
  std::uint32_t blocks[3] = {1, 1, 1};  ///< along each axis

  std::uint64_t first_of_rows = 1;    ///< a bit for the first cell of each row of a block
  std::uint64_t first_of_layers = 1;  ///< and of each layer

  double slack = 0.0;    ///< rounding_slack for rays from within reach
  double outward = 0.0;  ///< see local_box

  /// Sets what follows from bounds, cells and reach: the shape of the blocks, the center and all below.
  void prepare();

  [[nodiscard]] std::uint64_t cell_count() const { return std::uint64_t(cells[0]) * cells[1] * cells[2]; }
  [[nodiscard]] double plane(int axis, std::int64_t k) const {
    return bounds.lower[axis] + double(k) * cell[axis];
  }
  [[nodiscard]] std::size_t block_count() const { return std::size_t(blocks[0]) * blocks[1] * blocks[2]; }
  [[nodiscard]] std::uint32_t block_of(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return ((z >> shift[2]) * blocks[1] + (y >> shift[1])) * blocks[0] + (x >> shift[0]);
  }
  [[nodiscard]] std::uint32_t local_of(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    const auto inside = [&](int axis, std::uint32_t k) { return k & ((1U << shift[axis]) - 1U); };
    return (((inside(2, z) << shift[1]) | inside(1, y)) << shift[0]) | inside(0, x);
  }
  [[nodiscard]] std::uint32_t local_of(const Cell& c) const { return local_of(c[0], c[1], c[2]); }
  /// The cells of a block that are inside the grid.
  [[nodiscard]] CellRange cells_of_block(std::uint32_t block) const;
  /// The cells of a range that lies in one block: bit k is the cell with local_of() k. The product of the
  /// bits of a row, of its rows and of its layers, each of which are in their own place of what it is
  /// multiplied by.
  [[nodiscard]] std::uint64_t bits_of(const CellRange& part) const {
    const auto bits = [&](std::size_t axis, std::uint32_t scale) {
      const std::uint32_t inside = (1U << shift[axis]) - 1U;
      const std::uint32_t first = (part.lower[axis] & inside) << scale;
      const std::uint32_t end = ((part.upper[axis] & inside) + 1U) << scale;
      return (~std::uint64_t(0) >> (64 - end)) & (~std::uint64_t(0) << first);
    };
    return bits(0, 0) * (first_of_rows & bits(1, shift[0])) *
           (first_of_layers & bits(2, shift[0] + shift[1]));
  }
  /// The blocks that a range of cells touches, as a range of block coordinates.
  [[nodiscard]] CellRange blocks_of(const CellRange& range) const {
    CellRange touched;
    if (range.empty()) return touched;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      touched.lower[axis] = std::uint16_t(range.lower[axis] >> shift[axis]);
      touched.upper[axis] = std::uint16_t(range.upper[axis] >> shift[axis]);
    }
    return touched;
  }
  /// Index of the cell that holds coordinate x, clamped to the grid. Monotone in x.
  [[nodiscard]] std::uint16_t cell_of(int axis, double x) const {
    const double index = (x - bounds.lower[axis]) * inverse_cell[axis];
    return std::uint16_t(std::clamp(index, 0.0, double(cells[axis] - 1)));
  }
  /// Room around a box: what a hit of a ray from within reach can stray, and the rounding of the walk.
  [[nodiscard]] double pad(float drift) const { return double(drift) * reach + slack; }
  /// The box with its room.
  [[nodiscard]] Bounds3d grown(const InstanceBox& box) const {
    const double room = pad(box.drift);
    return {box.bounds.lower - Vec3d(room), box.bounds.upper + Vec3d(room)};
  }
  /// The cells that list a box; empty when the box with its room leaves the grid (or is empty).
  [[nodiscard]] CellRange range_of(const InstanceBox& box) const {
    const Bounds3d room = grown(box);
    return box.bounds.empty() || !bounds.contains(room) ? CellRange{} : range_within(room);
  }
  /// The cells of a box with its room, inside the bounds.
  [[nodiscard]] CellRange range_within(const Bounds3d& room) const {
    CellRange range;
    for (int axis = 0; axis < 3; ++axis) {
      range.lower[std::size_t(axis)] = cell_of(axis, room.lower[axis]);
      range.upper[std::size_t(axis)] = cell_of(axis, room.upper[axis]);
    }
    return range;
  }
  /// A box with its room, inside the bounds, in floats from the grid's centre. With E the largest extent of
  /// the grid its coordinates are at most E / 2, which rounds by less than 2^-26 E; `outward` is 2^-25 E.
  [[nodiscard]] Bounds3f local_box(const Bounds3d& room) const {
    return {Vec3f(room.lower - center - Vec3d(outward)), Vec3f(room.upper - center + Vec3d(outward))};
  }
};

}  // namespace gridcast::tlas
