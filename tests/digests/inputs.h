#pragma once
// What the pinned answers are about: scenes, rays, points and moved vertices that are the same bits on every
// machine. They are made of integers, sums, products, quotients and square roots, which IEEE 754 rounds in
// one way; sines and powers are not among them, because every mathematical library rounds those as it likes.

#include <string>
#include <vector>

#include "core/math/ray.h"
#include "core/scene/scene_data.h"

namespace gridcast::digests {

struct Input {
  std::string name;
  scene::SceneData data;  ///< with materials and lights
  Bounds3d bounds;        ///< of all vertices in the world
  /// At triangles, edges and vertices; along axes; with either end of the range on the surface; invalid ones;
  /// at the end bundles of neighbours, as packets want them.
  std::vector<Ray> rays;
  std::vector<PrimitiveRef> excluded;        ///< one a ray
  std::vector<Vec3d> points;                 ///< on and off the surfaces
  std::vector<std::vector<Vec3f>> deformed;  ///< positions of every mesh, morphed and skinned
};

[[nodiscard]] std::vector<Input> all_inputs();

}  // namespace gridcast::digests
