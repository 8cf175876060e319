#include "core/scene/spawn.h"

#include <cmath>
#include <limits>

#include "core/math/exact.h"

namespace gridcast::scene {
namespace {

// Claim: no ray from the origin o with n . d >= 0 on the side of the normal n hits the triangle at any t >=
// 0. In exact mode because o is off the plane. In robust mode the engine sees another ray, o' + t d', and
// rounds when it tests that. A, T and B are the transform's matrix, translation and stored inverse, r =
// 2^-53, D_k the largest |p_k - o'_k| of the corners, heights are n . (p - plane) and w = A^T n.
//
// 1. o' is computed here as the engine does it, and the height of A o' + T is measured: not estimated. The
//    origin counts as far enough off when both heights, less their certified errors, are at least 2. + 3.
// 2. A hit that the robust test accepts lies within 34 r D of a point P of the triangle, on every axis: a
//    sheared coordinate is off by 7 r D (triangle_test.h), the weights by 12 r of edges of at most 2 D, so
//    the depth by 27 r D with the rounding of corner, sum and quotient, and the depth moves the other axes by
//    as much. In height: sum_k |w_k| 36 r D.
// 3. d' = B d + e with |e| <= 3 r |B||d|, so a ray that leaves the plane may lose height on the way to object
//    space: per unit of t at most sum_j g_j |d_j|, g = |w B - n| + 3 r |w||B|. At a hit A (t d') = A (P - o')
//    up to 2., so |t d_j| <= max_k |A (p_k - o')|_j + 2 * 36 r (|A| D)_j + 2 round_trip_error |t d| = E_j,
//    the doubled terms with the rounding of the first. Together sum_j g_j E_j.
// 4. So a hit would lie higher than 2. allows.
//
// Rounding: w is off by 3 r |A|^T |n|, w B by 4 r of |A|^T |n| |B| more; 10 r |A|^T|n||B| + 2 r |n| in g
// covers both and the 3 r of step 3, and leaves r |n| for a direction whose side of the plane is in doubt.
//
// Sources: the error box of a hit point that is carried through transforms, and the offset along the normal
// until the box is cleared, rounded outward: "Physically Based Rendering", M. Pharr, 2023, 6.8. An offset
// that follows the floating-point grid instead: "A Fast and Robust Method for Avoiding Self-Intersection", C.
// Waechter, 2019. Changed: the height is measured with a certified error instead of bounded by a box; the way
// back into object space is counted, which neither does; and what the triangle test may get wrong is part of
// the bound, so that no ray needs a smallest t.
constexpr double kTriangleTest = 36.0 * 0x1p-53;
constexpr double kTransform = 10.0 * 0x1p-53;
/// Covers the rounding of the bounds themselves.
constexpr double kRoom = 1.0 + 0x1p-20;

Mat3d abs(const Mat3d& m) {
  return {glm::abs(m[0]), glm::abs(m[1]), glm::abs(m[2])};
}

/// At least this high on the side, whatever the error.
double least(const Certified& height, double side) {
  return side * height.high - height.size() * 0x1p-50 - height.error;
}

/// from + step * unit, each component rounded in the direction of `unit`.
Vec3d moved_outward(const Vec3d& from, double step, const Vec3d& unit) {
  Vec3d moved;
  for (int axis = 0; axis < 3; ++axis) {
    const TwoTerm sum = two_sum(from[axis], step * unit[axis]);
    const bool short_of = sum.low * unit[axis] > 0.0;
    moved[axis] = short_of ? std::nextafter(
                                 sum.high, std::copysign(std::numeric_limits<double>::infinity(), unit[axis]))
                           : sum.high;
  }
  return moved;
}

}  // namespace

SpawnPoint::SpawnPoint(const Scene& scene, const SurfaceHit& hit)
    : transform_(scene.instance(hit.instance_id).transform),
      corners_(scene.blas(hit.mesh_id).mesh().corners(hit.primitive_id)),
      plane_(transform_.world_from_object(), corners_),
      primitive_{hit.instance_id, hit.primitive_id} {
  const Vec3d p0(corners_[0]);
  const Affine& placed = transform_.world_from_object();
  position_ = placed.point(p0 + hit.u * (Vec3d(corners_[1]) - p0) + hit.v * (Vec3d(corners_[2]) - p0));

  const Certified3& certified_normal = plane_.normal();
  const Vec3d normal{certified_normal[0].high, certified_normal[1].high, certified_normal[2].high};
  const double size = max_abs(normal);
  const double scaled_length = glm::length(normal / size);
  unit_ = (normal / size) / scaled_length;
  length_ = size * scaled_length;

  const Mat3d& inverse = transform_.object_from_world_linear();
  const Vec3d pull = normal * placed.linear;  // A^T n
  const Vec3d pull_size = glm::abs(normal) * abs(placed.linear);
  object_pull_ = glm::abs(pull) + kTransform * pull_size;
  drift_ = glm::abs(pull * inverse - normal) + kTransform * (pull_size * abs(inverse)) +
           0x1p-52 * glm::abs(normal);
}

/// How much farther along the normal the origin has to be, in metres; not positive where it is proven to be
/// off.
double SpawnPoint::shortfall(const Vec3d& origin, double side) const {
  const Vec3d in_object = transform_.point_to_object(origin);
  const Mat3d& linear = transform_.world_from_object().linear;
  Vec3d reach(0.0), travel(0.0);
  for (const Vec3f& corner : corners_) {
    const Vec3d way = Vec3d(corner) - in_object;
    reach = glm::max(reach, glm::abs(way));
    travel = glm::max(travel, glm::abs(linear * way));
  }
  travel += 2.0 * kTriangleTest * (abs(linear) * reach) +
            Vec3d(2.0 * transform_.round_trip_error() * max_abs(travel));
  const double needed =
      kRoom * (kTriangleTest * max_abs(reach) * (object_pull_.x + object_pull_.y + object_pull_.z) +
               glm::dot(drift_, travel));
  const double height =
      std::min(least(plane_.height(origin), side), least(plane_.height_of_object_point(in_object), side));
  return (needed - height) / length_;
}

Vec3d SpawnPoint::off_plane(const Vec3d& from, double side) const {
  // The second pass finds nothing to do, or what the move has changed in the rounding of o'. What is needed
  // grows by less than a tenth of a step (kMaxCondition, kMaxRoundTripError), and each further pass demands
  // twice as much of what is missing, so that a few are enough; 64 more than any numbers can need.
  constexpr int kPasses = 64;
  Vec3d origin = from;
  double step = 0.0;
  for (int pass = 0; pass < kPasses; ++pass) {
    const double missing = shortfall(origin, side);
    if (!(missing > 0.0)) break;
    step += std::ldexp(missing, pass);
    origin = moved_outward(from, step, side * unit_);
  }
  return origin;
}

Vec3d SpawnPoint::origin(const Vec3d& from, const Vec3d& towards) const {
  return off_plane(from, plane_.along(towards).high < 0.0 ? -1.0 : 1.0);
}

Ray SpawnPoint::ray(const Vec3d& direction) const {
  return {origin(position_, direction), direction};
}

Ray SpawnPoint::ray_to(const Vec3d& target) const {
  const Vec3d start = off_plane(position_, plane_.height(target).high < 0.0 ? -1.0 : 1.0);
  return {start, target - start, 0.0, 1.0};
}

}  // namespace gridcast::scene
