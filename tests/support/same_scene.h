#pragma once
// Whether two scenes are the same to whoever asks them.

#include <gtest/gtest.h>

#include "core/scene/pose.h"
#include "core/scene/trace.h"
#include "tests/support/random.h"

namespace gridcast::test {

inline void expect_same_pose(const scene::Pose& a, const scene::Pose& b) {
  EXPECT_EQ(a.nodes->locals, b.nodes->locals);
  EXPECT_EQ(a.nodes->worlds, b.nodes->worlds);
  ASSERT_EQ(a.nodes->parts.size(), b.nodes->parts.size());
  for (std::size_t n = 0; n < a.nodes->parts.size(); ++n) {
    EXPECT_EQ(a.nodes->parts[n].translation, b.nodes->parts[n].translation);
    EXPECT_EQ(a.nodes->parts[n].rotation, b.nodes->parts[n].rotation);
    EXPECT_EQ(a.nodes->parts[n].scale, b.nodes->parts[n].scale);
  }
  EXPECT_EQ(a.weights, b.weights);
  EXPECT_EQ(a.joints, b.joints);
  ASSERT_EQ(a.animation.has_value(), b.animation.has_value());
  if (!a.animation) return;
  EXPECT_EQ(a.animation->animation_id, b.animation->animation_id);
  EXPECT_EQ(a.animation->time_s, b.animation->time_s);
}

/// Version, pose, names and masks, and every bit of the answers to rays into the box of `a`.
inline void expect_same_scene(const scene::Scene& a, const scene::Scene& b) {
  EXPECT_EQ(a.version(), b.version());
  expect_same_pose(a.pose(), b.pose());
  ASSERT_EQ(a.instance_slots(), b.instance_slots());
  for (std::uint32_t id = 0; id < a.instance_slots(); ++id) {
    EXPECT_EQ(a.instance(id).mask, b.instance(id).mask);
    EXPECT_EQ(a.instance_name(id), b.instance_name(id));
  }
  Random random(17);
  const Vec3d center = 0.5 * (a.bounds().lower + a.bounds().upper), half = 0.5 * a.bounds().extent();
  int hits = 0;
  for (int i = 0; i < 500; ++i) {
    Ray ray{center + 20.0 * random.direction(), {}};
    ray.direction = center + half * random.in_box(1.0) - ray.origin;
    const SurfaceHit x = intersect(a, ray), y = intersect(b, ray);
    hits += int(x.status == RayStatus::kHit);
    ASSERT_EQ(x.status, y.status);
    ASSERT_EQ(x.t, y.t);
    ASSERT_EQ(x.u, y.u);
    ASSERT_EQ(x.v, y.v);
    ASSERT_EQ(x.normal, y.normal);
    ASSERT_EQ(x.instance_id, y.instance_id);
    ASSERT_EQ(x.primitive_id, y.primitive_id);
  }
  EXPECT_GT(hits, 50);
}

}  // namespace gridcast::test
