#include "core/scene/hit_box.h"

namespace gridcast::scene {

// Claim: when the object-space test accepts t, the world point o + t d lies in bounds grown by drift * D.
// Norms are largest components and row sums; A, T, B are the transform's matrix, translation and stored
// inverse, e its round_trip_error, M the mesh's largest coordinate, L the largest |p - T| over p in the box.
//
// 1. x = o' + t d', the ray in object space, is within `pad` of a point P of a triangle (containment, see
//    ObjectRay), and pad <= 2^-17 M + 2^-41 |o'| + 2^-99: prepare() moves the origin to the box, so that the
//    moved origin is at most M (1 + 2^-40), and the shift at most (M + |o'|)(1 + 2^-40), or leaves it where
//    it is at most 3 M (then pad is 2^-19 (3 M + M), rounded, of which no hit uses up more than half).
// 2. Row n of A gives n . x <= n . P + |n|_1 pad, and n . P <= reach(n). So A x + T is in the box below but
//    for |A| 2^-41 |o'| <= 2^-41 |A||B| |o - T| (1 + 2^-40).
// 3. o + t d differs from A x + T by at most e |o - T| + e |t d|, and |t d| <= (D + its own share) (1 + 2 e).
// 4. |o - T| <= D + L. So the sum is below (2^-40 |A||B| + 4 e)(D + L), which is drift D + drift L; the part
//    with L does not depend on the ray and goes into the bounds.
//
// Rounding of the box: reach() by 5 u |n|_1 M with u = 2^-53, adding the growth and T by 3 u more of the sum
// of magnitudes, together below 2^-50 (|n|_1 M + |T|).
tlas::InstanceBox hit_box(const InstanceTransform& transform, const MeshHull& hull) {
  if (!transform.active() || hull.empty()) return {};
  const Affine& placed = transform.world_from_object();
  const double size = double(hull.magnitude());
  const double growth = 0x1p-17 * size + 0x1p-98;
  tlas::InstanceBox box;
  double linear_norm = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3d n{placed.linear[0][axis], placed.linear[1][axis], placed.linear[2][axis]};
    const double length = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    const double translation = placed.translation[axis];
    const double room = length * growth + 0x1p-50 * (length * size + std::abs(translation));
    const MeshHull::Reach reach = hull.reach(n);
    box.bounds.lower[axis] = translation - (reach.backward + room);
    box.bounds.upper[axis] = translation + (reach.forward + room);
    linear_norm = std::max(linear_norm, length);
  }

  const double stretch = linear_norm * row_sum_norm(transform.object_from_world_linear());
  const double drift = 0x1p-40 * stretch + 4.0 * transform.round_trip_error();
  // Rounded up to float.
  box.drift = float(drift * (1.0 + 0x1p-22));
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
