#pragma once
// Where to divide a set of boxes. Nothing here knows triangles or nodes.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/blas/blas.h"
#include "core/math/bounds.h"

namespace gridcast::blas {

/// What a builder knows of a primitive: its box, and the number that goes into the leaf.
struct BuildReference {
  Vec3f lower;
  std::uint32_t id;
  Vec3f upper;
  std::uint32_t unused = 0;  ///< rounds the size up to 32 bytes

  /// Twice the center: the order is the same, and no rounding is added by halving denormals.
  [[nodiscard]] Vec3f doubled_center() const { return lower + upper; }
};
static_assert(sizeof(BuildReference) == 32);

/// The boxes of a set of references, and their (doubled) centers.
struct SetBounds {
  Bounds3f boxes;
  Bounds3f centers;

  void extend(const BuildReference& reference) {
    boxes.lower = glm::min(boxes.lower, reference.lower);
    boxes.upper = glm::max(boxes.upper, reference.upper);
    centers.extend(reference.doubled_center());
  }
  void extend(const SetBounds& other) {
    boxes.extend(other.boxes);
    centers.extend(other.centers);
  }
};

/// In parallel for large sets; min and max give the same bits in any order as no coordinate is -0.
[[nodiscard]] SetBounds bounds_of(std::span<const BuildReference> references);

/// Two non-empty parts: [0, middle) and [middle, size).
struct Division {
  std::size_t middle = 0;
  SetBounds parts[2];
};

/// Halves by center along the longest axis of the centers; always possible for two or more references,
/// identical ones included (equal centers are ordered by id).
[[nodiscard]] Division divide_at_median(std::span<BuildReference> references, const SetBounds& bounds);

/// At the middle of the longest axis of the centers; none when all centers fall on one side.
[[nodiscard]] std::optional<Division> divide_at_midpoint(std::span<BuildReference> references,
                                                         const SetBounds& bounds);

/// A plane between two bins of one axis, and the surface-area cost of splitting there.
struct BinnedSplit {
  int axis = 0;
  std::uint32_t bin = 0;  ///< bins below it go to the first part
  std::uint32_t bin_count = 0;
  double cost = 0.0;  ///< in triangle tests per ray that meets the set's box, the node itself included
};

/// The cheapest of the planes between equal bins along each axis; none when all centers coincide. "On
/// fast Construction of SAH-based Bounding Volume Hierarchies", I. Wald, 2007; unlike the paper all three
/// axes are binned, and small sets get fewer bins.
[[nodiscard]] std::optional<BinnedSplit> find_binned_split(std::span<const BuildReference> references,
                                                           const SetBounds& bounds);
[[nodiscard]] Division divide_at_bin(std::span<BuildReference> references, const SetBounds& bounds,
                                     const BinnedSplit& split);

}  // namespace gridcast::blas
