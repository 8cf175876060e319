#include "core/scene/animation.h"

#include <algorithm>
#include <cmath>

namespace gridcast::scene {
namespace {

using Quaternion = std::array<double, 4>;

/// Beyond this cosine the arc is so short that its chord has the same points, to the last bit of double.
constexpr double kNearlyParallel = 1.0 - 1e-9;

/// "Animating Rotation with Quaternion Curves", K. Shoemake, 1985, on the shorter arc.
Quaternion slerp(const Quaternion& a, Quaternion b, double s) {
  double cosine = 0.0;
  for (std::size_t i = 0; i < 4; ++i) cosine += a[i] * b[i];
  if (cosine < 0.0) {
    for (double& part : b) part = -part;
    cosine = -cosine;
  }
  double of_a = 1.0 - s, of_b = s;
  if (cosine < kNearlyParallel) {
    const double angle = std::acos(cosine), sine = std::sin(angle);
    of_a = std::sin((1.0 - s) * angle) / sine;
    of_b = std::sin(s * angle) / sine;
  }
  Quaternion between{};
  for (std::size_t i = 0; i < 4; ++i) between[i] = of_a * a[i] + of_b * b[i];
  return normalized_rotation(between);
}

/// The rows of a channel's values: one per key, three for a cubic spline (in-tangent, value, out-tangent).
class Keys {
 public:
  explicit Keys(const AnimationChannel& channel) : channel_(channel), components_(component_count(channel)) {}

  [[nodiscard]] double value(std::size_t key, std::size_t i) const { return at(key, cubic() ? 1 : 0, i); }
  [[nodiscard]] double in_tangent(std::size_t key, std::size_t i) const { return at(key, 0, i); }
  [[nodiscard]] double out_tangent(std::size_t key, std::size_t i) const { return at(key, 2, i); }
  [[nodiscard]] Quaternion rotation(std::size_t key) const {
    return normalized_rotation({value(key, 0), value(key, 1), value(key, 2), value(key, 3)});
  }

 private:
  [[nodiscard]] bool cubic() const { return channel_.interpolation == Interpolation::kCubicSpline; }
  [[nodiscard]] double at(std::size_t key, std::size_t row, std::size_t i) const {
    return double(channel_.values[((cubic() ? 3 : 1) * key + row) * components_ + i]);
  }

  const AnimationChannel& channel_;
  std::size_t components_;
};

/// Between `key` and the next one, `s` of the way along an interval of `length_s`.
void interpolate_cubic(const Keys& keys, std::size_t key, double s, double length_s, std::span<double> out) {
  const double s2 = s * s, s3 = s2 * s;
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = (2.0 * s3 - 3.0 * s2 + 1.0) * keys.value(key, i) +
             length_s * (s3 - 2.0 * s2 + s) * keys.out_tangent(key, i) +
             (3.0 * s2 - 2.0 * s3) * keys.value(key + 1, i) +
             length_s * (s3 - s2) * keys.in_tangent(key + 1, i);
  }
}

void interpolate_linear(const Keys& keys, std::size_t key, double s, std::span<double> out) {
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = (1.0 - s) * keys.value(key, i) + s * keys.value(key + 1, i);
}

void normalize_rotation(std::span<double> out) {
  std::ranges::copy(normalized_rotation({out[0], out[1], out[2], out[3]}), out.begin());
}

}  // namespace

double duration_s(const Animation& animation) {
  double last = 0.0;
  for (const AnimationChannel& channel : animation.channels)
    if (!channel.times_s.empty()) last = std::max(last, double(channel.times_s.back()));
  return last;
}

std::size_t component_count(const AnimationChannel& channel) {
  if (channel.times_s.empty()) return 0;
  const std::size_t rows = channel.interpolation == Interpolation::kCubicSpline ? 3 : 1;
  return channel.values.size() / (rows * channel.times_s.size());
}

void sample(const AnimationChannel& channel, double time_s, std::span<double> out) {
  const auto& times = channel.times_s;
  if (times.empty()) return;
  const Keys keys(channel);
  const bool turns = channel.path == AnimationPath::kRotation;
  // The last key that is not after the time; before the first and after the last, those hold.
  const auto after = std::upper_bound(times.begin(), times.end(), time_s,
                                      [](double time, float key) { return time < double(key); });
  const std::size_t key = after == times.begin() ? 0 : std::size_t(after - times.begin()) - 1;
  const bool holds = after == times.begin() || after == times.end();
  if (holds || channel.interpolation == Interpolation::kStep) {
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = keys.value(key, i);
  } else {
    const double length_s = double(times[key + 1]) - double(times[key]);
    const double s = (time_s - double(times[key])) / length_s;
    if (channel.interpolation == Interpolation::kCubicSpline) {
      interpolate_cubic(keys, key, s, length_s, out);
    } else if (turns) {
      std::ranges::copy(slerp(keys.rotation(key), keys.rotation(key + 1), s), out.begin());
    } else {
      interpolate_linear(keys, key, s, out);
    }
  }
  if (turns) normalize_rotation(out);
}

}  // namespace gridcast::scene
