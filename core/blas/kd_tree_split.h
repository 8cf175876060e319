#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/math/bounds.h"

namespace gridcast::blas {

/// A triangle in a cell under construction: the box of the part of it that lies in the cell.
struct KdReference {
  Vec3f lower;
  std::uint32_t id;
  Vec3f upper;
};

/// Where triangles go that lie in the plane.
enum class PlanarSide : std::uint8_t { kBelow, kAbove };

struct KdSplit {
  int axis = 0;
  float plane = 0.F;
  PlanarSide planar = PlanarSide::kBelow;
  float cost = 0.F;  ///< of the two children as leaves and the step to them

  [[nodiscard]] bool goes_below(const KdReference& r) const {
    return r.lower[axis] < plane || (planar == PlanarSide::kBelow && r.upper[axis] == plane);
  }
  [[nodiscard]] bool goes_above(const KdReference& r) const {
    return r.upper[axis] > plane || (planar == PlanarSide::kAbove && r.lower[axis] == plane);
  }
};

/// A plane, in blocks of four triangles: a share of a step to a treelet, against gathering four triangles
/// from other lines. Of 0.3, 0.6 and 1 on a sphere, hair, a hall and a city the last took 6 to 31 % less
/// memory than the first at rays as fast or faster; 1.5 saves little more and tests a third more blocks.
inline constexpr float kKdPlaneCost = 1.F;
/// What a split that cuts off empty space costs, relative to its surface-area cost: rays that only graze
/// the mesh leave early, which the heuristic does not see. Value of I. Wald, 2006.
inline constexpr float kEmptySideFactor = 0.8F;
/// A leaf costs its blocks of four. Fewer triangles than this are one block and never split: measured, the
/// rest of the tree and the work of rays stay the same.
inline constexpr std::size_t kSmallestSplit = 5;
inline float leaf_cost(std::size_t count) {
  const std::size_t blocks = (count + 3) / 4;
  return float(blocks);
}

/// Up to here every side of every box is tried; above, kBinCount planes per axis at equal distances
/// ("Highly parallel fast kd-tree construction for interactive ray tracing of dynamic scenes", M. Shevtsov,
/// 2007). Modelled cost (not measured rays) at 64, 128 and 256: sphere 42.3, 42.4, 42.3, city of
/// boxes 71.9, 69.3, 68.1; the build takes 1, 1.06 and 1.25 times as long.
inline constexpr std::size_t kExactSplits = 128;

/// The cheapest plane strictly inside `cell` by the surface-area heuristic; none when there is no candidate.
[[nodiscard]] std::optional<KdSplit> find_split(std::span<const KdReference> references,
                                                const Bounds3f& cell);

/// The same for at most kExactSplits references, trying every side: kd_tree_sweep.cpp.
[[nodiscard]] std::optional<KdSplit> find_exact_split(std::span<const KdReference> references,
                                                      const Bounds3f& cell);

/// How likely a ray that meets the cell meets the part on one side of a plane: `cap` + `girth` times the
/// part's share of the cell's extent. A cell without area is a line, where lengths take the place of areas.
struct CellShape {
  float cap, girth;
  CellShape(const Bounds3f& cell, int axis);
};

}  // namespace gridcast::blas
