#pragma once
// The ray sets of the benchmark: what a renderer, a sensor or a light baker asks.

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/math/ray_batch.h"
#include "core/measure/scenes.h"
#include "core/scene/scene.h"

namespace gridcast::measure {

enum class RaySetKind : std::uint8_t {
  kPrimary,          ///< a camera's pixels, line by line
  kPrimaryShuffled,  ///< the same in random order
  kDiffuse,          ///< cosine-distributed bounces from what the camera sees, in the order of the picture
  kDiffuseShuffled,
  kAo,     ///< any hit within 5 % of the scene's diagonal, cosine-distributed, in the order of the picture
  kShadow  ///< any hit between what the camera sees and a point light
};
inline constexpr std::array kAllRaySets{RaySetKind::kPrimary, RaySetKind::kPrimaryShuffled,
                                        RaySetKind::kDiffuse, RaySetKind::kDiffuseShuffled,
                                        RaySetKind::kAo,      RaySetKind::kShadow};
/// primary, primary_shuffled, diffuse, diffuse_shuffled, ao, shadow.
[[nodiscard]] std::string_view to_string(RaySetKind kind);
[[nodiscard]] Result<RaySetKind> parse_ray_set(std::string_view name);

enum class QueryKind : std::uint8_t { kClosest, kAny };
[[nodiscard]] constexpr QueryKind query_of(RaySetKind kind) {
  return kind == RaySetKind::kAo || kind == RaySetKind::kShadow ? QueryKind::kAny : QueryKind::kClosest;
}
/// Whether neighbours in the set are neighbours in space, all heading the same way.
[[nodiscard]] constexpr bool is_coherent(RaySetKind kind) {
  return kind == RaySetKind::kPrimary || kind == RaySetKind::kShadow;
}

/// float32 rows of 8: ox oy oz tnear dx dy dz tfar, which is Embree's own layout too.
struct RaySet {
  RaySetKind kind = RaySetKind::kPrimary;
  std::vector<std::array<float, 8>> rows;

  [[nodiscard]] RayBatch batch() const {
    return {std::as_bytes(std::span(rows)), ScalarType::kFloat32, 8, {}};
  }
  [[nodiscard]] std::size_t size() const { return rows.size(); }
};

/// The sets of one scene. The camera's hits, from which bounces start, are found once.
class RaySetMaker {
 public:
  /// `count` rays a set.
  RaySetMaker(const scene::Scene& scene, const View& view, std::size_t count, std::uint64_t seed);

  /// kInvalidArgument when the camera sees nothing to bounce from.
  [[nodiscard]] Result<RaySet> make(RaySetKind kind) const;

 private:
  struct Start {
    Vec3d point, normal;  ///< the normal faces the camera
  };
  void find_starts(const scene::Scene& scene, const RaySet& primary);
  [[nodiscard]] RaySet primary() const;
  template <class MakeRow>
  [[nodiscard]] RaySet from_starts(RaySetKind kind, const MakeRow& make_row) const;

  View view_;
  std::size_t count_;
  std::uint64_t seed_;
  double diagonal_ = 1.0;
  Vec3d light_{0.0};
  std::vector<Start> starts_;
};

}  // namespace gridcast::measure
