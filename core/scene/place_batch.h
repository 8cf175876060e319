#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/math/affine.h"
#include "core/scene/mesh_hull.h"
#include "core/tlas/instance_box.h"

namespace gridcast::scene {

/// Up to eight instances to be placed at once: InstanceTransform and hit_box() of each, bit for bit, with
/// every instruction set.
class PlaceBatch {
 public:
  static constexpr std::size_t kSize = 8;

  void clear() {
    count_ = 0;
    one_hull_ = true;
  }
  [[nodiscard]] std::size_t size() const { return count_; }
  /// All of them live until place(), and each is written once.
  void add(const Affine& world_from_object, const MeshHull& hull, InstanceTransform& transform,
           tlas::InstanceBox& box) {
    from_[count_] = &world_from_object;
    hulls_[count_] = &hull;
    transforms_[count_] = &transform;
    boxes_[count_] = &box;
    one_hull_ &= &hull == hulls_[0];
    ++count_;
  }
  /// Writes the transforms and boxes of what was added, at least one; returns a bit for each whose transform
  /// is active. What is written of another means nothing.
  [[nodiscard]] std::uint32_t place();

  struct Lanes {
    const std::array<const Affine*, kSize>& from;
    const std::array<const MeshHull*, kSize>& hulls;
    const std::array<InstanceTransform*, kSize>& transforms;
    const std::array<tlas::InstanceBox*, kSize>& boxes;
    bool one_hull;  ///< all have the same
  };

 private:
  /// For lanes that have no instance.
  struct Spare {
    Affine from;
    InstanceTransform transform;
    tlas::InstanceBox box;
  };

  std::size_t count_ = 0;
  bool one_hull_ = true;
  std::array<const Affine*, kSize> from_{};
  std::array<const MeshHull*, kSize> hulls_{};
  std::array<InstanceTransform*, kSize> transforms_{};
  std::array<tlas::InstanceBox*, kSize> boxes_{};
  Spare spare_;
};

}  // namespace gridcast::scene
