#pragma once
// Where to divide a set of boxes. Nothing here knows triangles or nodes.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/blas/blas.h"
#include "core/blas/build_reference.h"

namespace gridcast::blas {

/// Two non-empty parts: [0, middle) and [middle, size).
struct Division {
  std::size_t middle = 0;
  std::array<SetBounds, 2> parts;
};

/// Halves in place by center along the longest axis of the centers; always possible for two or more
/// references, identical ones included (equal centers are ordered by id).
[[nodiscard]] Division divide_at_median(std::span<BuildReference> references, const SetBounds& bounds);

/// In place at the middle of the longest axis of the centers; none when all centers fall on one side.
[[nodiscard]] std::optional<Division> divide_at_midpoint(std::span<BuildReference> references,
                                                         const SetBounds& bounds);

/// Leaves are tested in blocks of this many triangles: a part of n costs ceil(n / block).
enum class LeafBlock : std::uint32_t { kOne = 1, kFour = 4 };
inline std::size_t blocks_of(std::size_t count, LeafBlock block) {
  return (count + std::size_t(block) - 1) / std::size_t(block);
}

/// A plane between two bins of one axis, and what it costs.
struct BinnedSplit {
  int axis = 0;
  float origin = 0.F;  ///< of the bins along `axis`, of doubled centers
  float scale = 0.F;   ///< bins per unit length
  float first_bin_of_right = 0.F;
  float cost = 0.F;  ///< half area times blocks of both parts, in units of AreaScale
  std::array<std::size_t, 2> counts{};
  std::array<Box4, 2> boxes;

  /// The same arithmetic as when bins were counted.
  [[nodiscard]] bool goes_right(const BuildReference& reference) const {
    return (reference.lower[axis] + reference.upper[axis] - origin) * scale >= first_bin_of_right;
  }
};

/// The cheapest of the planes between equal bins along each axis; none when all centers coincide. "On
/// fast Construction of SAH-based Bounding Volume Hierarchies", I. Wald, 2007; unlike the paper all three
/// axes are binned, and small sets get fewer bins. In parallel for large sets.
[[nodiscard]] std::optional<BinnedSplit> find_binned_split(std::span<const BuildReference> references,
                                                           const SetBounds& bounds, const AreaScale& areas,
                                                           LeafBlock block);

/// Copies the references to the two parts' places, each part in the order it had. Returns the parts' bounds.
/// The same result in parallel (large sets) and not.
[[nodiscard]] std::array<SetBounds, 2> divide_at_bin(std::span<const BuildReference> references,
                                                     const BinnedSplit& split, BuildReference* left,
                                                     BuildReference* right);

}  // namespace gridcast::blas
