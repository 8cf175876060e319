#include "core/scene/animation.h"

#include <cmath>

#include <glm/gtc/matrix_transform.hpp>
#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace gridcast::scene {
namespace {

AnimationChannel channel_of(AnimationPath path, Interpolation interpolation, std::size_t components,
                            std::vector<float> times, test::Random& random) {
  AnimationChannel channel{0, path, interpolation, std::move(times), {}};
  const std::size_t rows = interpolation == Interpolation::kCubicSpline ? 3 : 1;
  for (std::size_t i = 0; i < channel.times_s.size() * rows * components; ++i)
    channel.values.push_back(float(random.uniform(-2.0, 2.0)));
  return channel;
}

std::vector<double> sampled(const AnimationChannel& channel, double time_s) {
  std::vector<double> out(component_count(channel));
  sample(channel, time_s, out);
  return out;
}

/// The key before a time and how far it is to the next one, by looking at each.
std::pair<std::size_t, long double> place(const AnimationChannel& channel, double time_s) {
  std::size_t key = 0;
  while (key + 2 < channel.times_s.size() && double(channel.times_s[key + 1]) <= time_s) ++key;
  const long double a = channel.times_s[key], b = channel.times_s[key + 1];
  return {key, std::clamp((static_cast<long double>(time_s) - a) / (b - a), 0.0L, 1.0L)};
}

TEST(Animation, steps_and_lines_pass_through_their_keys_and_hold_outside) {
  test::Random random(test::seed_or(81));
  for (const auto interpolation : {Interpolation::kStep, Interpolation::kLinear}) {
    const auto channel =
        channel_of(AnimationPath::kTranslation, interpolation, 3, {0.5F, 1.F, 1.25F, 4.F}, random);
    for (const double time : {-3.0, 0.0, 0.5, 0.75, 0.9999, 1.0, 1.1, 1.25, 3.0, 4.0, 99.0}) {
      const auto [key, s] = place(channel, time);
      const bool jump = interpolation == Interpolation::kStep;
      for (std::size_t i = 0; i < 3; ++i) {
        const long double a = channel.values[3 * key + i], b = channel.values[3 * key + 3 + i];
        const long double wanted = jump ? (s < 1.0L ? a : b) : a + s * (b - a);
        EXPECT_NEAR(sampled(channel, time)[i], double(wanted), 1e-14) << time;
      }
    }
  }
}

TEST(Animation, splines_meet_values_and_tangents_scaled_by_the_interval) {
  test::Random random(test::seed_or(82));
  const auto channel =
      channel_of(AnimationPath::kWeights, Interpolation::kCubicSpline, 5, {0.F, 0.5F, 3.F}, random);
  const auto row = [&](std::size_t key, std::size_t kind, std::size_t i) {
    return double(channel.values[(3 * key + kind) * 5 + i]);
  };
  constexpr double kStep = 1e-6;
  for (std::size_t i = 0; i < 5; ++i) {
    for (std::size_t key = 0; key < 3; ++key)
      EXPECT_NEAR(sampled(channel, double(channel.times_s[key]))[i], row(key, 1, i), 1e-14);
    // The slope on either side of the middle key, in units of value per second.
    EXPECT_NEAR((sampled(channel, 0.5 + kStep)[i] - row(1, 1, i)) / kStep, row(1, 2, i), 1e-4);
    EXPECT_NEAR((row(1, 1, i) - sampled(channel, 0.5 - kStep)[i]) / kStep, row(1, 0, i), 1e-4);
    EXPECT_EQ(sampled(channel, 17.0)[i], row(2, 1, i));
    EXPECT_EQ(sampled(channel, -1.0)[i], row(0, 1, i));
  }
  // A cubic through four conditions is the only one: compare a point inside with de Casteljau's construction.
  for (std::size_t i = 0; i < 5; ++i) {
    const double h = 2.5, p0 = row(1, 1, i), p3 = row(2, 1, i);
    const double p1 = p0 + h * row(1, 2, i) / 3.0, p2 = p3 - h * row(2, 0, i) / 3.0, s = 0.3;
    const auto mix = [s](double a, double b) { return a + s * (b - a); };
    const double a = mix(p0, p1), b = mix(p1, p2), c = mix(p2, p3);
    EXPECT_NEAR(sampled(channel, 0.5 + s * h)[i], mix(mix(a, b), mix(b, c)), 1e-13);
  }
}

/// The matrix of a quaternion from turning the axes one by one: q v q*.
Vec3d turned(const std::vector<double>& q, const Vec3d& v) {
  const Vec3d axis(q[0], q[1], q[2]);
  return v + 2.0 * glm::cross(axis, glm::cross(axis, v) + q[3] * v);
}

TEST(Animation, rotations_turn_at_constant_speed_on_the_shorter_arc) {
  test::Random random(test::seed_or(83));
  for (int round = 0; round < 300; ++round) {
    // From a random rotation, by an angle below half a turn about a random axis.
    const double angle = round % 5 == 0 ? 1e-6 : random.uniform(0.01, 3.1);
    const Vec3d axis = random.direction(), from_axis = random.direction();
    const double from_angle = random.uniform(0.0, 6.0);
    const auto quaternion = [](const Vec3d& about, double by) {
      const Vec3d v = std::sin(0.5 * by) * about;
      return std::array<double, 4>{v.x, v.y, v.z, std::cos(0.5 * by)};
    };
    const auto a = quaternion(from_axis, from_angle), d = quaternion(axis, angle);
    const Vec3d av(a[0], a[1], a[2]), dv(d[0], d[1], d[2]);
    const Vec3d bv = d[3] * av + a[3] * dv + glm::cross(dv, av);
    const double bw = d[3] * a[3] - glm::dot(dv, av);
    // The same rotation has two quaternions of any length: the far one, and keys that are not unit.
    const double sign = random.below(2) == 0 ? -1.7 : 1.3;
    AnimationChannel channel{0, AnimationPath::kRotation, Interpolation::kLinear, {1.F, 3.F}, {}};
    for (const double value : a) channel.values.push_back(float(value));
    for (const double value : {bv.x, bv.y, bv.z, bw}) channel.values.push_back(float(sign * value));
    const double s = random.uniform();
    const auto q = sampled(channel, 1.0 + 2.0 * s);
    EXPECT_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-14);
    const Mat3d partly(glm::rotate(glm::dmat4(1.0), s * angle, axis));
    const Mat3d start(glm::rotate(glm::dmat4(1.0), from_angle, from_axis));
    for (const Vec3d& v : {Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)})
      EXPECT_LT(max_abs(turned(q, v) - partly * (start * v)), 2e-6) << "angle " << angle << ", s " << s;
  }
}

TEST(Animation, spline_rotations_come_out_unit_and_one_key_holds) {
  test::Random random(test::seed_or(84));
  const auto spline =
      channel_of(AnimationPath::kRotation, Interpolation::kCubicSpline, 4, {0.F, 1.F}, random);
  for (const double time : {-1.0, 0.0, 0.4, 1.0, 2.0}) {
    const auto q = sampled(spline, time);
    EXPECT_NEAR(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], 1.0, 1e-14);
  }
  const auto single = channel_of(AnimationPath::kScale, Interpolation::kCubicSpline, 3, {2.F}, random);
  for (const double time : {0.0, 2.0, 5.0}) EXPECT_EQ(sampled(single, time)[1], double(single.values[4]));
  EXPECT_EQ(duration_s({"", {spline, single}}), 2.0);
  EXPECT_EQ(duration_s({}), 0.0);
}

}  // namespace
}  // namespace gridcast::scene
