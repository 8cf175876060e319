#pragma once
// Rays that are traced at the same time, each for itself: none has to be near another.

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/blas/blas.h"
#include "core/blas/exact_packet.h"

namespace gridcast::blas {

/// Most rays that are on their way at once. More would hide more of what each waits for, but their state has
/// to stay in the first-level cache.
inline constexpr std::size_t kStreamSize = 16;

/// One ray of a stream, and the tree it goes through; different rays may have different trees.
template <Precision kPrecision>
struct StreamRay {
  const Blas* blas;
  const mesh::ObjectRay* ray;  ///< as Blas::intersect takes it, or intersect_exact
  BestOf<kPrecision>* best;    ///< of closest hits, as there; of different rays different
  double tfar;                 ///< of any hit, as Blas::occluded takes it
};

struct StreamResult {
  std::uint32_t hits = 0;   ///< a bit for each ray whose `best` was replaced (any hit: which is occluded)
  std::uint32_t steps = 0;  ///< nodes and blocks of wide trees that the rays looked at, each for itself
};

/// Blas::intersect, or for kExact intersect_exact, of at most kStreamSize rays: the same answers.
template <Precision kPrecision>
StreamResult intersect_stream(std::span<const StreamRay<kPrecision>> rays);
/// Blas::occluded or occluded_exact of at most kStreamSize rays.
template <Precision kPrecision>
[[nodiscard]] StreamResult occluded_stream(std::span<const StreamRay<kPrecision>> rays);

}  // namespace gridcast::blas
