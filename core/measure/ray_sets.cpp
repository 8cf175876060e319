#include "core/measure/ray_sets.h"

#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "core/measure/random.h"
#include "core/scene/trace.h"

namespace gridcast::measure {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// Bounces start this share of the diagonal away: far above the rounding of a float origin.
constexpr double kOffset = 1e-5;
constexpr double kAoReach = 0.05;

constexpr std::array<std::pair<RaySetKind, std::string_view>, 6> kNames{
    {{RaySetKind::kPrimary, "primary"},
     {RaySetKind::kPrimaryShuffled, "primary_shuffled"},
     {RaySetKind::kDiffuse, "diffuse"},
     {RaySetKind::kDiffuseShuffled, "diffuse_shuffled"},
     {RaySetKind::kAo, "ao"},
     {RaySetKind::kShadow, "shadow"}}};

std::array<float, 8> row(const Vec3d& origin, double tnear, const Vec3d& direction, float tfar) {
  return {float(origin.x),    float(origin.y),    float(origin.z),    float(tnear),
          float(direction.x), float(direction.y), float(direction.z), tfar};
}

/// Cosine-distributed around a unit normal: the normal plus a point of the unit sphere.
Vec3d diffuse_direction(const Vec3d& normal, Random& random) {
  for (;;) {
    const Vec3d direction = normal + random.direction();
    const double length = glm::length(direction);
    if (length > 1e-3) return direction / length;
  }
}

void shuffle(RaySet& set, std::uint64_t seed) {
  Random random(seed + 400);
  for (std::size_t i = set.size(); i > 1; --i)
    std::swap(set.rows[i - 1], set.rows[random.below(std::uint32_t(i))]);
}

}  // namespace

std::string_view to_string(RaySetKind kind) {
  for (const auto& [known, name] : kNames)
    if (known == kind) return name;
  return "unknown";
}

Result<RaySetKind> parse_ray_set(std::string_view name) {
  for (const auto& [kind, known] : kNames)
    if (known == name) return kind;
  return Error{ErrorCode::kInvalidArgument, "there is no ray set '" + std::string(name.substr(0, 40)) + "'",
               "/set"};
}

RaySetMaker::RaySetMaker(const scene::Scene& scene, const View& view, std::size_t count, std::uint64_t seed)
    : view_(view), count_(count), seed_(seed) {
  const Bounds3d bounds = scene.bounds();
  if (!bounds.empty()) diagonal_ = glm::length(bounds.extent());
  light_ = view.light.value_or(view.eye + 0.3 * diagonal_ * view.up);
  find_starts(scene, primary());
}

RaySet RaySetMaker::primary() const {
  const auto width = std::size_t(std::ceil(std::sqrt(double(count_))));
  const std::size_t height = (count_ + width - 1) / width;
  const Vec3d forward = glm::normalize(view_.target - view_.eye);
  const Vec3d right = glm::normalize(glm::cross(forward, view_.up));
  const Vec3d up = glm::cross(right, forward);
  const double half = std::tan(0.5 * view_.yfov_deg * kPi / 180.0);
  RaySet set;
  set.rows.reserve(count_);
  for (std::size_t i = 0; i < count_; ++i) {
    const std::size_t line = i / width;
    const double x = (2.0 * (double(i % width) + 0.5) / double(width) - 1.0) * half;
    const double y = (1.0 - 2.0 * (double(line) + 0.5) / double(height)) * half;
    set.rows.push_back(row(view_.eye, 0.0, glm::normalize(forward + x * right + y * up), kInfinity));
  }
  return set;
}

void RaySetMaker::find_starts(const scene::Scene& scene, const RaySet& primary) {
  const auto hits = scene::intersect(scene, primary.batch(), {});
  if (!hits) return;
  for (std::size_t i = 0; i < primary.size(); ++i) {
    if (hits->status[i] != RayStatus::kHit) continue;
    const Ray ray = primary.batch()[i];
    Vec3d normal{hits->normal[3 * i], hits->normal[3 * i + 1], hits->normal[3 * i + 2]};
    if (glm::dot(normal, ray.direction) > 0.0) normal = -normal;
    starts_.push_back({ray.origin + hits->t[i] * ray.direction, normal});
  }
}

template <class MakeRow>
RaySet RaySetMaker::from_starts(RaySetKind kind, const MakeRow& make_row) const {
  RaySet set{kind, {}};
  set.rows.reserve(count_);
  // Every hit of the camera starts about equally many rays, in the order of the picture.
  for (std::size_t i = 0; i < count_; ++i) set.rows.push_back(make_row(starts_[i * starts_.size() / count_]));
  return set;
}

Result<RaySet> RaySetMaker::make(RaySetKind kind) const {
  if (kind != RaySetKind::kPrimary && kind != RaySetKind::kPrimaryShuffled && starts_.empty())
    return Error{ErrorCode::kInvalidArgument, "the camera sees nothing, so nothing bounces", "/view"};
  Random random(seed_ + 500);
  RaySet set;
  if (kind == RaySetKind::kPrimary || kind == RaySetKind::kPrimaryShuffled) {
    set = primary();
  } else if (kind == RaySetKind::kShadow) {
    set = from_starts(kind, [&](const Start& start) {
      const Vec3d origin = start.point + kOffset * diagonal_ * start.normal;
      return row(origin, 0.0, light_ - origin, 1.F);
    });
  } else {
    const float reach = kind == RaySetKind::kAo ? float(kAoReach * diagonal_) : kInfinity;
    set = from_starts(kind, [&](const Start& start) {
      return row(start.point + kOffset * diagonal_ * start.normal, 0.0,
                 diffuse_direction(start.normal, random), reach);
    });
  }
  set.kind = kind;
  if (kind == RaySetKind::kPrimaryShuffled || kind == RaySetKind::kDiffuseShuffled) shuffle(set, seed_);
  return set;
}

}  // namespace gridcast::measure
