#include "core/scene/hit_box.h"

namespace gridcast::scene {

// Claim: when the object-space test accepts t, the world point o + t d lies in bounds grown by drift * D.
// Norms are largest components and row sums; A, T, B are the transform's matrix, translation and stored
// inverse, e its round_trip_error, M the mesh's largest coordinate, L the largest |p - T| over p in the box.
//
// 1. x = o' + t d', the ray in object space, is within `pad` of a point of the mesh's box (containment, see
//    ObjectRay), and pad <= 2^-17 M + 2^-41 |o'| + 2^-99: prepare() moves the origin to the box, so that the
//    moved origin is at most M (1 + 2^-40), and the shift at most (M + |o'|)(1 + 2^-40).
// 2. A x + T is thus in the world box of the mesh's box grown by 2^-17 M + 2^-98 (in float, with room for its
//    rounding), but for |A| 2^-41 |o'| <= 2^-41 |A||B| |o - T| (1 + 2^-40).
// 3. o + t d differs from A x + T by at most e |o - T| + e |t d|, and |t d| <= (D + its own share) (1 + 2 e).
// 4. |o - T| <= D + L. So the sum is below (2^-40 |A||B| + 4 e)(D + L), which is drift D + drift L; the part
//    with L does not depend on the ray and goes into the bounds.
tlas::InstanceBox hit_box(const InstanceTransform& transform, const Bounds3f& object) {
  if (!transform.active() || object.empty()) return {};
  Bounds3f grown = object;
  const float growth = 0x1p-17F * object.magnitude() + 0x1p-98F;
  grown.lower -= Vec3f(growth);
  grown.upper += Vec3f(growth);

  const Affine& placed = transform.world_from_object();
  const double stretch = row_sum_norm(placed.linear) * row_sum_norm(transform.object_from_world_linear());
  const double drift = 0x1p-40 * stretch + 4.0 * transform.round_trip_error();
  // Rounded up to float.
  tlas::InstanceBox box{transform.bounds_to_world(grown), float(drift * (1.0 + 0x1p-22))};
  const double reach = max_abs(glm::max(glm::abs(box.bounds.lower - placed.translation),
                                        glm::abs(box.bounds.upper - placed.translation)));
  const double outward = double(box.drift) * reach * (1.0 + 0x1p-40);
  // Subtracting `outward` rounds by less than 2^-53 of the box's coordinates.
  const double rounding = 0x1p-52 * (box.bounds.magnitude() + outward);
  box.bounds.lower -= Vec3d(outward + rounding);
  box.bounds.upper += Vec3d(outward + rounding);
  return box;
}

}  // namespace gridcast::scene
