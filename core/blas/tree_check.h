#pragma once
// What the trees that are read from bytes are checked for, each check linear in the tree.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/math/bounds.h"

namespace gridcast::blas {

inline Error wrong_tree(const std::string& what, std::size_t node) {
  return {ErrorCode::kInvalidFile, "the tree " + what, "/nodes/" + std::to_string(node)};
}

/// Corners are numbers, the lower ones first.
inline bool is_proper_box(const Bounds3f& box) {
  for (int axis = 0; axis < 3; ++axis)
    if (!(std::isfinite(box.lower[axis]) && std::isfinite(box.upper[axis]) &&
          box.lower[axis] <= box.upper[axis]))
      return false;
  return true;
}

/// Things that are to be named once each.
class Once {
 public:
  explicit Once(std::size_t count) : seen_(count, false), left_(count) {}

  /// False when it was named before; `index` is in range.
  bool name(std::size_t index) {
    if (seen_[index]) return false;
    seen_[index] = true;
    --left_;
    return true;
  }
  [[nodiscard]] bool all() const { return left_ == 0; }
  [[nodiscard]] std::size_t size() const { return seen_.size(); }

 private:
  std::vector<bool> seen_;
  std::size_t left_;
};

}  // namespace gridcast::blas
