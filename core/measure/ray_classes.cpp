#include "core/measure/ray_classes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/scene/points.h"

namespace gridcast::measure {
namespace {

constexpr std::array<std::string_view, kAllRayClasses.size()> kNames{
    "random", "edge", "vertex", "grazing", "axis", "coherent", "diffuse", "shadow"};

constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// Points tried, and kept, inside closed meshes.
constexpr std::size_t kInsideTries = 16'384, kInsidePoints = 4096;
/// Tries to find a triangle with area, or an origin apart from its target.
constexpr int kTries = 64;
/// Grazing angles, in powers of ten of a radian.
constexpr double kLeastAngle = -6.0, kGreatestAngle = -1.0;

/// From origin to target, both as floats; the direction is their difference, rounded once.
std::array<float, 8> aimed(const Vec3d& origin, const Vec3d& target) {
  const Vec3f from(origin), to(target);
  const Vec3f direction(Vec3d(to) - Vec3d(from));
  return {from.x, from.y, from.z, 0.F, direction.x, direction.y, direction.z, kInfinity};
}

bool has_direction(const std::array<float, 8>& row) {
  return row[4] != 0.F || row[5] != 0.F || row[6] != 0.F;
}

bool is_picture_class(RayClass ray_class) {
  return ray_class == RayClass::kCoherent || ray_class == RayClass::kDiffuse ||
         ray_class == RayClass::kShadow;
}

}  // namespace

std::string_view to_string(RayClass ray_class) {
  return kNames[std::size_t(ray_class)];
}

Result<RayClass> parse_ray_class(std::string_view name) {
  for (const RayClass ray_class : kAllRayClasses)
    if (to_string(ray_class) == name) return ray_class;
  return Error{ErrorCode::kInvalidArgument, "there is no ray class '" + std::string(name.substr(0, 40)) + "'",
               "/ray_class"};
}

RayClassMaker::RayClassMaker(const scene::Scene& scene, const View& view, std::uint64_t seed)
    : scene_(scene), view_(view), seed_(seed), bounds_(scene.bounds()) {
  if (!bounds_.empty()) diagonal_ = glm::length(bounds_.extent());
  list_instances();
  Random random(seed + 600);
  find_inside_points(random);
}

void RayClassMaker::list_instances() {
  std::uint64_t total = 0;
  for (std::uint32_t id = 0; id < scene_.instance_slots(); ++id) {
    const auto instance = scene_.find_instance(id);
    if (!instance || !instance->transform.active()) continue;
    const std::size_t count = scene_.blas(instance->mesh_id).mesh().triangle_count();
    if (count == 0) continue;
    instances_.push_back(id);
    triangles_.push_back(total += count);
  }
}

void RayClassMaker::find_inside_points(Random& random) {
  std::vector<Vec3f> tried;
  for (std::size_t i = 0; i < kInsideTries && !instances_.empty(); ++i) {
    const scene::Instance instance = scene_.instance(random_instance(random));
    const blas::Blas& blas = scene_.blas(instance.mesh_id);
    if (!blas.has_inside()) continue;
    const Bounds3d box = to_double(blas.bounds());
    const Vec3d share{random.uniform(), random.uniform(), random.uniform()};
    tried.emplace_back(instance.transform.world_from_object().point(box.lower + share * box.extent()));
  }
  const auto found =
      scene::points_inside(scene_, {std::as_bytes(std::span(tried)), ScalarType::kFloat32}, {});
  if (!found) return;
  for (std::size_t i = 0; i < tried.size() && inside_.size() < kInsidePoints; ++i)
    if (found->place[i] == PointPlace::kInside) inside_.push_back(tried[i]);
}

/// By the number of triangles.
std::uint32_t RayClassMaker::random_instance(Random& random) const {
  const std::uint64_t wanted = random.bits() % triangles_.back();
  const auto at = std::upper_bound(triangles_.begin(), triangles_.end(), wanted);
  return instances_[std::size_t(at - triangles_.begin())];
}

RayClassMaker::Target RayClassMaker::random_target(Random& random) const {
  const scene::Instance instance = scene_.instance(random_instance(random));
  const mesh::TriangleMesh& mesh = scene_.blas(instance.mesh_id).mesh();
  const auto corners = mesh.corners(random.below(std::uint32_t(mesh.triangle_count())));
  // A random corner first, so that any edge is as likely as its neighbours.
  const std::uint32_t first = random.below(3);
  Target target;
  for (std::uint32_t k = 0; k < 3; ++k)
    target.corners[k] = instance.transform.world_from_object().point(Vec3d(corners[(first + k) % 3]));
  return target;
}

Vec3d RayClassMaker::point_in_box(Random& random) const {
  return bounds_.lower + Vec3d{random.uniform(), random.uniform(), random.uniform()} * bounds_.extent();
}

Vec3d RayClassMaker::origin(std::size_t i, Random& random) const {
  if (i % 3 == 0 && !inside_.empty()) return Vec3d(inside_[random.below(std::uint32_t(inside_.size()))]);
  if (i % 3 == 1) return point_in_box(random);
  const double distance = random.uniform(0.6, 2.0) * diagonal_;
  return bounds_.center() + distance * random.direction();
}

RayClassMaker::Row RayClassMaker::random_row(std::size_t i, Random& random) const {
  const Vec3d from = origin(i, random);
  // From outside most directions would lead away.
  const Vec3d to = i % 3 == 2 ? point_in_box(random) : from + diagonal_ * random.direction();
  return aimed(from, to);
}

RayClassMaker::Row RayClassMaker::grazing_row(Random& random) const {
  const Target target = random_target(random);
  const Vec3d edge = target.corners[1] - target.corners[0], other = target.corners[2] - target.corners[0];
  const Vec3d normal = glm::cross(edge, other);
  if (!(glm::length(normal) > 0.0)) return {};
  const double turn = random.uniform(0.0, 6.28318530717958647692);
  const Vec3d x = glm::normalize(edge), y = glm::normalize(glm::cross(normal, edge));
  const Vec3d along = std::cos(turn) * x + std::sin(turn) * y;
  const double angle = std::pow(10.0, random.uniform(kLeastAngle, kGreatestAngle));
  const double side = random.below(2) == 0 ? -1.0 : 1.0;
  const Vec3d direction = std::cos(angle) * along + side * std::sin(angle) * glm::normalize(normal);
  const double u = random.uniform(), v = random.uniform(0.0, 1.0 - u);
  const Vec3d at = target.at(u, v);
  return aimed(at - diagonal_ * std::pow(10.0, random.uniform(-2.0, 0.0)) * direction, at);
}

RayClassMaker::Row RayClassMaker::axis_row(std::size_t i, Random& random) const {
  const auto axis = std::size_t(random.below(3));
  const Vec3f from(i % 2 == 0 ? random_target(random).corners[0] : point_in_box(random));
  Row row{from.x, from.y, from.z, 0.F, 0.F, 0.F, 0.F, kInfinity};
  const bool up = random.below(2) == 0;
  for (std::size_t k = 0; k < 3; ++k) row[4 + k] = random.below(2) == 0 ? -0.F : 0.F;
  row[4 + axis] = up ? 1.F : -1.F;
  row[axis] = float(bounds_.center()[int(axis)] + (up ? -1.0 : 1.0) * random.uniform(0.0, 1.0) * diagonal_);
  return row;
}

RayClassMaker::Row RayClassMaker::row(RayClass ray_class, std::size_t i, Random& random) const {
  if (ray_class == RayClass::kGrazing) return grazing_row(random);
  if (ray_class == RayClass::kAxis) return axis_row(i, random);
  if (ray_class == RayClass::kRandom) return random_row(i, random);
  const Vec3d from = origin(i, random);
  const Target target = random_target(random);
  return aimed(from, target.at(ray_class == RayClass::kEdge ? random.uniform() : 0.0, 0.0));
}

Result<RaySet> RayClassMaker::make(RayClass ray_class, std::size_t count) const {
  if (is_picture_class(ray_class)) {
    const RaySetKind kind = ray_class == RayClass::kCoherent  ? RaySetKind::kPrimary
                            : ray_class == RayClass::kDiffuse ? RaySetKind::kDiffuse
                                                              : RaySetKind::kShadow;
    return RaySetMaker(scene_, view_, count, seed_).make(kind);
  }
  if (instances_.empty())
    return Error{ErrorCode::kInvalidArgument, "the scene has no triangle that a ray could hit", ""};
  Random random(seed_ + 700 + std::uint64_t(ray_class));
  // Closest hits of rays without neighbours.
  RaySet set{RaySetKind::kPrimaryShuffled, {}};
  set.rows.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    Row made = row(ray_class, i, random);
    for (int k = 0; k < kTries && !has_direction(made); ++k) made = row(ray_class, i, random);
    set.rows.push_back(has_direction(made) ? made : random_row(i, random));
  }
  return set;
}

Result<std::vector<std::uint8_t>> RayClassMaker::starts_inside(const RaySet& rays,
                                                               const std::stop_token& stop) const {
  std::vector<Vec3f> origins;
  origins.reserve(rays.size());
  for (const Row& row : rays.rows) origins.emplace_back(row[0], row[1], row[2]);
  const auto found = scene::points_inside(scene_, {std::as_bytes(std::span(origins)), ScalarType::kFloat32},
                                          {.stop = stop, .progress = {}});
  if (!found) return found.error();
  std::vector<std::uint8_t> inside(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i)
    inside[i] = found->place[i] == PointPlace::kInside && rays.rows[i][7] == kInfinity ? 1 : 0;
  return inside;
}

}  // namespace gridcast::measure
