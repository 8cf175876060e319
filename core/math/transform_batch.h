#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/math/affine.h"

namespace gridcast {

/// Eight instance transforms at once, side by side in the lanes of vectors. What comes out is
/// InstanceTransform bit for bit, with every instruction set: the same operations in the same order, none of
/// them fused.
class TransformBatch {
 public:
  static constexpr std::size_t kSize = 8;
  /// One number of each transform.
  using Lanes = std::array<double, kSize>;
  /// [column][row], as in Mat3d.
  using MatrixLanes = std::array<std::array<Lanes, 3>, 3>;
  using VectorLanes = std::array<Lanes, 3>;

  /// All lanes hold the identity.
  TransformBatch();
  void set(std::size_t lane, const Affine& world_from_object);
  /// Makes the inverses of what was set.
  void invert();

  /// Bit k: lane k is active. What is said of an inactive lane below means nothing.
  [[nodiscard]] std::uint32_t active() const { return active_; }
  void get(std::size_t lane, InstanceTransform& transform) const;
  /// The same for lanes 0, 1, ..., faster.
  void get(std::span<InstanceTransform* const> transforms) const;

  [[nodiscard]] const MatrixLanes& linear() const { return linear_; }
  [[nodiscard]] const VectorLanes& translation() const { return translation_; }
  [[nodiscard]] const MatrixLanes& inverse() const { return inverse_; }
  [[nodiscard]] const Lanes& round_trip_error() const { return round_trip_error_; }

 private:
  alignas(64) MatrixLanes linear_;
  VectorLanes translation_;
  MatrixLanes inverse_;
  Lanes condition_, round_trip_error_;
  std::uint32_t active_ = 0;
};

}  // namespace gridcast
