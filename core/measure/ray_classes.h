#pragma once
// The classes of rays that the tradeoff between speed and accuracy is measured on: what programs ask, and
// what numbers of limited precision get wrong.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/measure/random.h"
#include "core/measure/ray_sets.h"
#include "core/measure/scenes.h"
#include "core/scene/scene.h"

namespace gridcast::measure {

enum class RayClass : std::uint8_t {
  kRandom,    ///< any direction
  kEdge,      ///< at a point of an edge, as rounded to float
  kVertex,    ///< at a vertex, as rounded to float
  kGrazing,   ///< at a triangle, 1e-1 to 1e-6 rad from its plane
  kAxis,      ///< along an axis, two components +0 or -0; half of them through a vertex
  kCoherent,  ///< a camera's pixels, line by line
  kDiffuse,   ///< cosine-distributed bounces from what the camera sees
  kShadow     ///< any hit between what the camera sees and a point light
};
inline constexpr std::array kAllRayClasses{RayClass::kRandom,  RayClass::kEdge,  RayClass::kVertex,
                                           RayClass::kGrazing, RayClass::kAxis,  RayClass::kCoherent,
                                           RayClass::kDiffuse, RayClass::kShadow};
/// random, edge, vertex, grazing, axis, coherent, diffuse, shadow.
[[nodiscard]] std::string_view to_string(RayClass ray_class);
[[nodiscard]] Result<RayClass> parse_ray_class(std::string_view name);

/// Makes rays of every class for one scene. Rays of the first four classes start in equal parts inside a
/// closed mesh (where there are any), anywhere in the scene's box, and outside of it.
class RayClassMaker {
 public:
  /// Keeps `scene`, whose box is not empty.
  RayClassMaker(const scene::Scene& scene, const View& view, std::uint64_t seed);

  /// `count` rays. kInvalidArgument when the camera sees nothing to bounce from (diffuse, shadow).
  [[nodiscard]] Result<RaySet> make(RayClass ray_class, std::size_t count) const;
  /// For every ray whether it starts inside a closed mesh (winding number not 0) and has no far end, so that
  /// it cannot help hitting something. Error: kCancelled.
  [[nodiscard]] Result<std::vector<std::uint8_t>> starts_inside(const RaySet& rays,
                                                                const std::stop_token& stop) const;

 private:
  /// A triangle of an instance, as the world sees it.
  struct Target {
    std::array<Vec3d, 3> corners;
    [[nodiscard]] Vec3d at(double u, double v) const {
      return (1.0 - u - v) * corners[0] + u * corners[1] + v * corners[2];
    }
  };
  using Row = std::array<float, 8>;

  void list_instances();
  void find_inside_points(Random& random);
  [[nodiscard]] std::uint32_t random_instance(Random& random) const;
  [[nodiscard]] Target random_target(Random& random) const;
  [[nodiscard]] Vec3d point_in_box(Random& random) const;
  [[nodiscard]] Vec3d origin(std::size_t i, Random& random) const;
  [[nodiscard]] Row row(RayClass ray_class, std::size_t i, Random& random) const;
  [[nodiscard]] Row random_row(std::size_t i, Random& random) const;
  [[nodiscard]] Row grazing_row(Random& random) const;
  [[nodiscard]] Row axis_row(std::size_t i, Random& random) const;

  const scene::Scene& scene_;
  View view_;
  std::uint64_t seed_;
  Bounds3d bounds_;
  double diagonal_ = 1.0;
  std::vector<std::uint32_t> instances_;  ///< that can be hit
  std::vector<std::uint64_t> triangles_;  ///< of those before and this one
  std::vector<Vec3f> inside_;             ///< points inside closed meshes
};

}  // namespace gridcast::measure
