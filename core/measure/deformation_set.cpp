#include "core/measure/deformation_set.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "core/math/bounds.h"
#include "core/measure/random.h"

namespace gridcast::measure {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kTwistTurns = 4.0;

constexpr std::array<std::pair<Deformation, std::string_view>, kAllDeformations.size()> kNames{
    {{Deformation::kWobble, "wobble"},
     {Deformation::kTwist, "twist"},
     {Deformation::kFold, "fold"},
     {Deformation::kExplode, "explode"},
     {Deformation::kCollapsePlane, "collapse_plane"},
     {Deformation::kCollapseLine, "collapse_line"},
     {Deformation::kCollapsePoint, "collapse_point"},
     {Deformation::kShuffle, "shuffle"},
     {Deformation::kReturn, "return"}}};

/// (x, y) turned by `angle`.
std::pair<double, double> turned(double x, double y, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {c * x - s * y, s * x + c * y};
}

/// Vertices seen from the centre of their box, in units of its largest extent.
class RestFrame {
 public:
  explicit RestFrame(std::span<const Vec3f> rest) : rest_(rest) {
    Bounds3f bounds;
    for (const Vec3f& p : rest) bounds.extend(p);
    if (bounds.empty()) return;
    centre_ = to_double(bounds).center();
    const double extent = max_abs(to_double(bounds).extent());
    if (extent > 0.0) size_ = extent;
  }

  template <class Move>
  [[nodiscard]] std::vector<Vec3f> moved(const Move& move) const {
    std::vector<Vec3f> to;
    to.reserve(rest_.size());
    for (const Vec3f& p : rest_) to.emplace_back(centre_ + size_ * move((Vec3d(p) - centre_) / size_));
    return to;
  }

 private:
  std::span<const Vec3f> rest_;
  Vec3d centre_{0.0};
  double size_ = 1.0;
};

std::vector<Vec3f> dealt_out(std::span<const Vec3f> rest, std::uint64_t seed) {
  std::vector<Vec3f> to(rest.begin(), rest.end());
  Random random(seed);
  for (std::size_t i = to.size(); i > 1; --i) std::swap(to[i - 1], to[random.below(std::uint32_t(i))]);
  return to;
}

std::vector<Vec3f> exploded(const RestFrame& frame, double phase, std::uint64_t seed) {
  const double reach = std::pow(10.0, 6.0 * phase - 2.0);
  Random random(seed + 600);
  return frame.moved([&](const Vec3d& p) {
    const double speed = random.uniform();
    return p + reach * speed * random.direction();
  });
}

/// From a shuffle `share` of the way to rest.
std::vector<Vec3f> partly_returned(std::span<const Vec3f> rest, double share, std::uint64_t seed) {
  std::vector<Vec3f> to = dealt_out(rest, seed + 700);
  if (share == 0.0) return to;
  for (std::size_t i = 0; i < to.size(); ++i)
    to[i] = Vec3f(Vec3d(rest[i]) + (1.0 - share) * (Vec3d(to[i]) - Vec3d(rest[i])));
  return to;
}

}  // namespace

std::string_view to_string(Deformation deformation) {
  for (const auto& [known, name] : kNames)
    if (known == deformation) return name;
  return "unknown";
}

std::vector<Vec3f> deformed(Deformation deformation, std::span<const Vec3f> rest, double phase,
                            std::uint64_t seed) {
  const bool at_rest = deformation == Deformation::kReturn ? phase > 0.5 : phase == 0.0;
  if (at_rest) return {rest.begin(), rest.end()};
  const RestFrame frame(rest);
  switch (deformation) {
    case Deformation::kWobble:
      return frame.moved([phase](const Vec3d& p) {
        const double run = 6.0 * kPi * phase;
        return p + 0.1 * Vec3d(0.0, std::sin(run + 7.0 * p.x), std::sin(run + 9.0 * p.y));
      });
    case Deformation::kTwist:
      return frame.moved([phase](const Vec3d& p) {
        const auto [x, z] = turned(p.x, p.z, 2.0 * kPi * kTwistTurns * phase * p.y);
        return Vec3d(x, p.y, z);
      });
    case Deformation::kFold:
      return frame.moved([phase](const Vec3d& p) {
        if (p.x <= 0.0) return p;
        const auto [x, y] = turned(p.x, p.y, kPi * phase);
        return Vec3d(x, y, p.z);
      });
    case Deformation::kExplode:
      return exploded(frame, phase, seed);
    case Deformation::kCollapsePlane:
      return frame.moved([left = 1.0 - phase](const Vec3d& p) { return Vec3d(p.x, left * p.y, p.z); });
    case Deformation::kCollapseLine:
      return frame.moved([left = 1.0 - phase](const Vec3d& p) { return Vec3d(p.x, left * p.y, left * p.z); });
    case Deformation::kCollapsePoint:
      return frame.moved([left = std::max(1e-6, 1.0 - phase)](const Vec3d& p) { return left * p; });
    case Deformation::kShuffle:
      return dealt_out(rest, seed ^ std::bit_cast<std::uint64_t>(phase));
    case Deformation::kReturn:
      return partly_returned(rest, phase, seed);
  }
  return {};
}

}  // namespace gridcast::measure
