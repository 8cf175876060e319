#pragma once
// Batches of pairs of points.

#include <span>

#include "core/math/point_batch.h"

namespace gridcast {

/// A view of N segments as little-endian row-major [N, 6] (the point that looks, the point it looks for), in
/// world space. Owns nothing; the bytes need no alignment. `excluded` and `targets`, when not empty, have N
/// entries: the primitive that the first point lies on, and that the second one lies on.
struct PairBatch {
  std::span<const std::byte> bytes;
  ScalarType scalar = ScalarType::kFloat64;
  std::span<const PrimitiveRef> excluded;
  std::span<const PrimitiveRef> targets;

  [[nodiscard]] std::size_t size() const { return bytes.size() / (6 * size_bytes(scalar)); }
  [[nodiscard]] Vec3d from(std::size_t i) const { return PointBatch{bytes, scalar}[2 * i]; }
  [[nodiscard]] Vec3d to(std::size_t i) const { return PointBatch{bytes, scalar}[2 * i + 1]; }
};

}  // namespace gridcast
