#include "core/scene/trace.h"

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace gridcast::scene {
namespace {

TEST(SceneTrace, one_triangle_is_hit_with_ids_weights_and_normal) {
  SceneData data;
  data.meshes.push_back(test::share(test::single_triangle()));
  data.instances.push_back({SharedText("one"), {Mat3d(2.0), Vec3d(10, 0, 0)}, 0});
  const auto scene = build_scene(std::move(data));
  ASSERT_TRUE(scene.ok());
  const SurfaceHit hit = intersect(**scene, {{10.5, 0.5, 3}, {0, 0, -2}});
  ASSERT_EQ(hit.status, RayStatus::kHit);
  EXPECT_EQ(hit.t, 1.5);
  EXPECT_EQ(hit.u, 0.25);
  EXPECT_EQ(hit.v, 0.25);
  EXPECT_EQ(hit.instance_id, 0U);
  EXPECT_EQ(hit.mesh_id, 0U);
  EXPECT_EQ(hit.primitive_id, 0U);
  EXPECT_EQ(hit.normal, Vec3d(0, 0, 1));
}

}  // namespace
}  // namespace gridcast::scene
