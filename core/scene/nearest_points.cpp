#include <new>

#include "core/blas/point_sink.h"
#include "core/mesh/nearest_point.h"
#include "core/scene/batch_loop.h"
#include "core/scene/points.h"

namespace gridcast::scene {
namespace {

constexpr std::size_t kPointsPerBlock = 256;

/// The nearest surface point so far; starts as {max_distance}.
struct Nearest {
  double distance;
  std::uint32_t instance_id = kInvalidId;
  std::uint32_t primitive_id = kInvalidId;
  double u = 0.0, v = 0.0;
  Vec3d offset{0.0};  ///< from the point asked about

  [[nodiscard]] bool nearer_than(const Nearest& other) const {
    if (distance != other.distance) return distance < other.distance;
    if (instance_id != other.instance_id) return instance_id < other.instance_id;
    return primitive_id < other.primitive_id;
  }
};

/// Upper bound of the largest factor by which m lengthens a vector: the square root of the largest row sum of
/// |m^T m| or |m m^T|, which is exact for a rotation with one scale.
double stretch(const Mat3d& m) {
  const double largest = std::max({max_abs(m[0]), max_abs(m[1]), max_abs(m[2])});
  const Mat3d unit = m * (1.0 / largest);
  const double square =
      std::min(row_sum_norm(glm::transpose(unit) * unit), row_sum_norm(unit * glm::transpose(unit)));
  return largest * std::sqrt(square) * (1.0 + 0x1p-40);
}

/// How far in object space to look for what is within a world distance of the point p.
///
/// With q the point in object space as rounded, A and T the transform, B its stored inverse, and e
/// round_trip_error(), the largest component of A q + T - p is at most e |p - T|, its length 2 e |p - T|. For
/// a triangle's point x, with w the length of A x + T - p, A (x - q) is at most w + 2 e |p - T| long, and x -
/// q = A^-1 A (x - q) at most stretch(B) (1 + 4 e) times that, as A^-1 = B (A B)^-1 and A B is within e of
/// the identity. The distance computed for a triangle is that of a point of it but for the rounding of its
/// corners and weights, together below 2^-46 (|A| M + |p - T|) with M the mesh's largest coordinate.
struct ObjectReach {
  double factor, slack;

  ObjectReach(const InstanceTransform& transform, const Vec3d& point, double mesh_size) {
    const double error = transform.round_trip_error();
    const double away = max_abs(point - transform.world_from_object().translation);
    factor = stretch(transform.object_from_world_linear()) * (1.0 + 4.0 * error);
    slack = 2.0 * error * away +
            0x1p-46 * (row_sum_norm(transform.world_from_object().linear) * mesh_size + away);
  }
  [[nodiscard]] double radius(double distance) const { return factor * (distance + slack); }
};

/// Measures the triangles of one instance, in world space.
class NearestSink final : public blas::PointSink {
 public:
  NearestSink(const mesh::TriangleMesh& mesh, const InstanceTransform& transform, std::uint32_t instance_id,
              const Vec3d& point, double mesh_size, Nearest& best)
      : PointSink(transform.point_to_object(point), 0.0),
        mesh_(mesh),
        linear_(transform.world_from_object().linear),
        from_point_(transform.world_from_object().translation - point),
        reach_(transform, point, mesh_size),
        instance_id_(instance_id),
        best_(best) {
    set_radius(reach_.radius(best.distance));
  }

  void offer(std::uint32_t primitive_id) override {
    const auto [p0, p1, p2] = mesh_.corners(primitive_id);
    const mesh::NearestPoint found =
        mesh::nearest_to_origin(linear_ * Vec3d(p0) + from_point_, linear_ * Vec3d(p1) + from_point_,
                                linear_ * Vec3d(p2) + from_point_);
    const Nearest candidate{found.distance, instance_id_, primitive_id, found.u, found.v, found.point};
    if (!candidate.nearer_than(best_)) return;
    best_ = candidate;
    set_radius(reach_.radius(best_.distance));
  }

 private:
  const mesh::TriangleMesh& mesh_;
  const Mat3d& linear_;
  Vec3d from_point_;
  ObjectReach reach_;
  std::uint32_t instance_id_;
  Nearest& best_;
};

Nearest find_nearest(const Scene& scene, const Vec3d& point, const NearestOptions& options) {
  Nearest best{options.max_distance};
  scene.top_level().search(point, options.max_distance, [&](std::uint32_t id) {
    const Instance instance = scene.instance(id);
    if (!instance.seen_by(options.mask)) return best.distance;
    const blas::Blas& blas = scene.blas(instance.mesh_id);
    NearestSink sink(blas.mesh(), instance.transform, id, point, double(blas.bounds().magnitude()), best);
    blas.search(sink);
    return best.distance;
  });
  return best;
}

}  // namespace

Result<NearestColumns> nearest_points(const Scene& scene, const PointBatch& points,
                                      const NearestOptions& options) try {
  NearestColumns out;
  out.resize(points.size());
  const bool whole = for_each_in_blocks(points.size(), kPointsPerBlock, options.stop, options.progress,
                                        [&](std::size_t i, std::size_t /*block*/) {
                                          const Vec3d point = points[i];
                                          if (!is_valid_point(point)) {
                                            out.status[i] = RayStatus::kInvalid;
                                            return true;
                                          }
                                          const Nearest best = find_nearest(scene, point, options);
                                          if (best.primitive_id == kInvalidId) return true;
                                          out.status[i] = RayStatus::kHit;
                                          out.distance[i] = best.distance;
                                          for (int axis = 0; axis < 3; ++axis)
                                            out.position[3 * i + std::size_t(axis)] =
                                                point[axis] + best.offset[axis];
                                          out.uv[2 * i] = float(best.u);
                                          out.uv[2 * i + 1] = float(best.v);
                                          out.instance_id[i] = best.instance_id;
                                          out.mesh_id[i] = scene.instance(best.instance_id).mesh_id;
                                          out.primitive_id[i] = best.primitive_id;
                                          return true;
                                        });
  if (!whole) return Error{ErrorCode::kCancelled, "the search was cancelled", ""};
  return out;
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the answers", ""};
}

}  // namespace gridcast::scene
