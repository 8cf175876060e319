#pragma once

#include <cstddef>
#include <type_traits>

#include "core/math/affine.h"

namespace gridcast {

/// An InstanceTransform as the 22 doubles that it takes in memory, for code that makes several at once.
class TransformRows {
 public:
  static constexpr std::size_t kLinear = 0;       ///< nine, column by column
  static constexpr std::size_t kTranslation = 9;  ///< three
  static constexpr std::size_t kInverse = 12;     ///< nine, column by column
  static constexpr std::size_t kError = 21;       ///< round_trip_error(): infinite when inactive
  static constexpr std::size_t kCount = 22;

  /// To be written, all of them.
  [[nodiscard]] static double* of(InstanceTransform& transform) {
    static_assert(std::is_trivially_copyable_v<InstanceTransform> &&
                  std::is_standard_layout_v<InstanceTransform>);
    static_assert(sizeof(InstanceTransform) == kCount * sizeof(double));
    static_assert(offsetof(InstanceTransform, object_from_world_linear_) == kInverse * sizeof(double));
    static_assert(offsetof(InstanceTransform, round_trip_error_) == kError * sizeof(double));
    void* const place = &transform;
    return static_cast<double*>(place);
  }
  /// The first twelve of them.
  [[nodiscard]] static const double* of(const Affine& world_from_object) {
    static_assert(sizeof(Affine) == kInverse * sizeof(double) && std::is_standard_layout_v<Affine>);
    static_assert(offsetof(Affine, translation) == kTranslation * sizeof(double));
    const void* const place = &world_from_object;
    return static_cast<const double*>(place);
  }
};

}  // namespace gridcast
