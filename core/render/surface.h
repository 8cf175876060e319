#pragma once

#include "core/math/hit.h"
#include "core/scene/scene.h"

namespace gridcast::render {

enum class Side : std::uint8_t { kFront, kBack };

/// A hit as shading needs it. All vectors are in world space.
struct Surface {
  Vec3d point{0.0};
  Vec3d view{0.0};       ///< unit, towards where the ray came from
  Vec3d geometric{0.0};  ///< unit normal of the triangle, on the viewer's side
  Vec3d normal{
      0.0};  ///< unit normal for shading: interpolated where the mesh has normals, on the viewer's side
  Vec3d smooth_point{
      0.0};  ///< `point` lifted onto the curved surface that the normals pretend; shadow rays' start
  Side side = Side::kFront;  ///< front: the ray came from the side of counter-clockwise winding
  SurfaceHit hit;
  [[nodiscard]] PrimitiveRef primitive() const { return {hit.instance_id, hit.primitive_id}; }
  const scene::Material* material = nullptr;  ///< never null
};

/// `hit` is a hit of `ray` with `scene`.
[[nodiscard]] Surface make_surface(const scene::Scene& scene, const Ray& ray, const SurfaceHit& hit);

/// Where a ray starts that leaves the surface from `point` on the viewer's side, or on the other one: see
/// scene::SpawnPoint. Neighbours in the same plane are as near as the triangle itself, which is excluded
/// beside.
enum class Leave : std::uint8_t { kTowardsViewer, kThrough };
[[nodiscard]] Vec3d spawn_origin(const scene::Scene& scene, const Surface& surface, const Vec3d& point,
                                 Leave leave);

}  // namespace gridcast::render
