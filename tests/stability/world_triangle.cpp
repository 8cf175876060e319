#include "tests/stability/world_triangle.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace gridcast::stability {
namespace {

constexpr Wide kRoot3 = 1.7320508075688772936L;

Wide length(const Wide3& v) {
  return std::sqrt(glm::dot(v, v));
}
Wide largest(const Wide3& v) {
  return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}
/// The cross product with every difference made a sum.
Wide3 cross_of_sizes(const Wide3& a, const Wide3& b) {
  const Wide3 p = glm::abs(a), q = glm::abs(b);
  return {p.y * q.z + p.z * q.y, p.z * q.x + p.x * q.z, p.x * q.y + p.y * q.x};
}

/// The stored inverse B of A: the largest row sums of |A B - I| and of |A||B|, and e.
struct RoundTrip {
  Wide residual = 0, condition = 0, error = 0;
};

/// e is the residual and twelve roundings of |A||B| for what is computed with B, by rows.
RoundTrip round_trip(const InstanceTransform& transform) {
  const Mat3d& a = transform.world_from_object().linear;
  const Mat3d& b = transform.object_from_world_linear();
  RoundTrip worst;
  for (int row = 0; row < 3; ++row) {
    Wide off = 0, sizes = 0;
    for (int column = 0; column < 3; ++column) {
      Wide sum = row == column ? -1 : 0;
      for (int k = 0; k < 3; ++k) {
        const Wide product = Wide(a[k][row]) * Wide(b[column][k]);
        sum += product;
        sizes += std::abs(product);
      }
      off += std::abs(sum);
    }
    worst.residual = std::max(worst.residual, off);
    worst.condition = std::max(worst.condition, sizes);
    worst.error = std::max(worst.error, off + 12 * 0x1p-53L * sizes);
  }
  return worst;
}

/// How close the line between tnear and tfar comes to the segment from a to b, all relative to the origin.
Wide distance(const Ray& ray, const Wide3& a, const Wide3& b) {
  const Wide3 d(ray.direction), e = b - a;
  const Wide dd = glm::dot(d, d), de = glm::dot(d, e), ee = glm::dot(e, e);
  const auto clamp_t = [&](Wide t) { return std::clamp(t, Wide(ray.tnear), Wide(ray.tfar)); };
  const auto clamp_s = [](Wide s) { return std::clamp(s, Wide(0), Wide(1)); };
  Wide best = std::numeric_limits<Wide>::infinity();
  // From the ends and from where the lines come closest; twice back and forth for the clamped one.
  const Wide determinant = dd * ee - de * de;
  const Wide inner = determinant > 0 ? (de * glm::dot(d, a) - dd * glm::dot(e, a)) / determinant : 0;
  for (Wide s : {Wide(0), Wide(1), clamp_s(inner)}) {
    for (int turn = 0; turn < 2; ++turn) {
      const Wide t = clamp_t(glm::dot(d, a + s * e) / dd);
      best = std::min(best, length(a + s * e - t * d));
      if (ee > 0) s = clamp_s(glm::dot(e, t * d - a) / ee);
    }
  }
  return best;
}

}  // namespace

WorldTriangle::WorldTriangle(const InstanceTransform& transform, const std::array<Vec3f, 3>& corners)
    : transform_(transform) {
  const RoundTrip inverse = round_trip(transform);
  round_trip_ = inverse.error;
  inverse_roundings_ = double(inverse.residual / (0x1p-53L * inverse.condition));
  const Affine& placed = transform.world_from_object();
  const Wide3 a(placed.linear[0]), b(placed.linear[1]), c(placed.linear[2]);
  for (std::size_t i = 0; i < 3; ++i) {
    const Wide3 p(corners[i]);
    corners_[i] = a * p.x + b * p.y + c * p.z + Wide3(placed.translation);
  }
  const Wide3 first = Wide3(corners[1]) - Wide3(corners[0]), second = Wide3(corners[2]) - Wide3(corners[0]);
  const Wide3 n = glm::cross(first, second), sizes = cross_of_sizes(first, second);
  const Wide3 bc = glm::cross(b, c), ca = glm::cross(c, a), ab = glm::cross(a, b);
  determinant_ = glm::dot(a, bc);
  const Wide side = determinant_ < 0 ? -1 : 1;
  image_ = side * (n.x * bc + n.y * ca + n.z * ab);
  sums_ = largest(sizes.x * glm::abs(bc) + sizes.y * glm::abs(ca) + sizes.z * glm::abs(ab));
  object_normal_ = length(n);
}

bool WorldTriangle::is_image(const Ray& ray) const {
  const Affine& placed = transform_.world_from_object();
  const Vec3d local = ray.origin - placed.translation;
  return placed.linear == Mat3d(1.0) && Wide3(local) == Wide3(ray.origin) - Wide3(placed.translation);
}

Wide WorldTriangle::turn(const Ray& ray, Wide reach) const {
  if (is_image(ray)) return 0;
  const Wide3 away = Wide3(ray.origin) - Wide3(transform_.world_from_object().translation);
  return kRoot3 * round_trip_ * (largest(away) + reach);
}

bool WorldTriangle::is_undecided(const Ray& ray, double t, double mesh_size) const {
  const double to_end = std::min(std::abs(t - ray.tnear), std::abs(ray.tfar - t));
  if (height_share(ray, t, to_end, mesh_size) <= 1.0) return true;
  if (is_image(ray)) return false;
  Wide3 relative[3];
  Wide reach = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    relative[i] = corners_[i] - Wide3(ray.origin);
    reach = std::max(reach, length(relative[i]));
  }
  const Wide allowed = turn(ray, reach);
  for (std::size_t i = 0; i < 3; ++i)
    if (distance(ray, relative[i], relative[(i + 1) % 3]) <= allowed) return true;
  return false;
}

double WorldTriangle::height_share(const Ray& ray, double t, double t_off, double mesh_size) const {
  const Wide slope = std::abs(glm::dot(image_, Wide3(ray.direction))) / length(image_);
  const Wide local = max_abs(transform_.point_to_object(ray.origin));
  const Wide turned = turn(ray, std::abs(Wide(t)) * largest(Wide3(ray.direction)));
  // A^-T n / |n| is image / determinant / |n|: across the plane, object space is stretched by 1 over its
  // length.
  const Wide contained = kRoot3 * 0x1p-49L * (local + Wide(mesh_size)) * std::abs(determinant_) *
                         object_normal_ / length(image_);
  return double(Wide(t_off) * slope / (turned + contained));
}

double WorldTriangle::normal_share(const Vec3d& normal) const {
  const Wide size = length(image_);
  if (!(size > 0)) return 0.0;
  const Wide allowed = 3 * kRoot3 * round_trip_ + kRoot3 * 0x1p-50L * sums_ / size;
  if (!(allowed < 1)) return 0.0;
  const Wide3 truth = image_ / size;
  if (!(glm::dot(truth, Wide3(normal)) > 0)) return std::numeric_limits<double>::infinity();
  return double(length(glm::cross(truth, Wide3(normal))) / allowed);
}

}  // namespace gridcast::stability
