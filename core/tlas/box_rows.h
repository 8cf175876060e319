#pragma once

#include <cstddef>
#include <type_traits>

#include "core/tlas/instance_box.h"

namespace gridcast::tlas {

/// An InstanceBox as the seven doubles that it takes in memory, for code that reads or writes several at
/// once.
class BoxRows {
 public:
  static constexpr std::size_t kUpper = 3;  ///< the first of three; those of the lower corner are before
  static constexpr std::size_t kDrift = 6;  ///< a float in the lower half, and padding
  static constexpr std::size_t kCount = 7;

  [[nodiscard]] static const double* of(const InstanceBox& box) {
    static_assert(std::is_trivially_copyable_v<InstanceBox> && std::is_standard_layout_v<InstanceBox>);
    static_assert(sizeof(InstanceBox) == kCount * sizeof(double));
    static_assert(offsetof(InstanceBox, bounds) == 0);
    static_assert(offsetof(InstanceBox, drift) == kDrift * sizeof(double));
    const void* const place = &box;
    return static_cast<const double*>(place);
  }
  /// To be written, all of them.
  [[nodiscard]] static double* of(InstanceBox& box) {
    return const_cast<double*>(of(static_cast<const InstanceBox&>(box)));
  }
};

}  // namespace gridcast::tlas
