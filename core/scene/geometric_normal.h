#pragma once
// Normals of hits, one by one and many at once, with the same bits.

#include <array>
#include <cstddef>
#include <span>

#include "core/math/hit.h"
#include "core/scene/scene.h"

namespace gridcast::scene {

/// Unit world normal of the geometric kind, from the corners in double; on the side of counter-clockwise
/// winding in object space. A sliver whose area is lost to rounding has no side: it faces `ray`.
[[nodiscard]] Vec3d geometric_normal(const Scene& scene, const Hit& hit, const Ray& ray);

/// The normals of eight hits, made in vectors. One for each thread; keeps a reference to the scene.
class NormalBatch {
 public:
  static constexpr std::size_t kSize = 8;

  explicit NormalBatch(const Scene& scene) : scene_(scene) {}

  /// Puts a valid hit into a lane below kSize.
  void set(std::size_t lane, const Hit& hit, const Ray& ray);
  /// Of all lanes; those that were never set give anything.
  void make();
  [[nodiscard]] Vec3d normal(std::size_t lane) const {
    return {normal_[0][lane], normal_[1][lane], normal_[2][lane]};
  }

  /// A row of numbers, one a lane.
  using Lanes = std::array<double, kSize>;

 private:
  const Scene& scene_;
  alignas(64) std::array<Lanes, 6> edges_{};              ///< two edges of the triangle: ax ay az bx by bz
  alignas(64) std::array<Lanes, 9> object_from_world_{};  ///< column-major
  alignas(64) std::array<Lanes, 3> normal_{};
  std::array<std::uint32_t, kSize> instance_ = filled_with_none();
  std::array<const Ray*, kSize> ray_{};

  static constexpr std::array<std::uint32_t, kSize> filled_with_none() {
    std::array<std::uint32_t, kSize> none{};
    none.fill(kInvalidId);
    return none;
  }
};

}  // namespace gridcast::scene
