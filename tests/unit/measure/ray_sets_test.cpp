#include "core/measure/ray_sets.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "core/scene/trace.h"

namespace gridcast::measure {
namespace {

class RaySets : public testing::Test {
 protected:
  static constexpr std::size_t kRays = 5000;
  BenchScene bench_ = make_scene("S1", 5, 0.05).value();
  std::shared_ptr<const scene::Scene> scene_ = scene::build_scene(bench_.data).value();
  RaySetMaker maker_{*scene_, bench_.view, kRays, 5};

  [[nodiscard]] RaySet make(RaySetKind kind) const { return maker_.make(kind).value(); }
};

TEST_F(RaySets, EverySetHasAsManyValidRaysAsAskedFor) {
  for (const RaySetKind kind : kAllRaySets) {
    SCOPED_TRACE(to_string(kind));
    const RaySet set = make(kind);
    ASSERT_EQ(set.size(), kRays);
    EXPECT_EQ(set.kind, kind);
    for (std::size_t i = 0; i < set.size(); ++i) ASSERT_TRUE(is_valid(set.batch()[i]));
    EXPECT_EQ(parse_ray_set(to_string(kind)).value(), kind);
  }
}

TEST_F(RaySets, ManyPrimaryRaysHitAndManyMiss) {
  const auto hits = scene::intersect(*scene_, make(RaySetKind::kPrimary).batch(), {});
  const auto count = std::count(hits->status.begin(), hits->status.end(), RayStatus::kHit);
  EXPECT_GT(count, std::ptrdiff_t(kRays / 5));
  EXPECT_LT(count, std::ptrdiff_t(kRays));
}

TEST_F(RaySets, ShuffledSetsHoldTheSameRaysInAnotherOrder) {
  for (const auto& [ordered, mixed] : {std::pair{RaySetKind::kPrimary, RaySetKind::kPrimaryShuffled},
                                       std::pair{RaySetKind::kDiffuse, RaySetKind::kDiffuseShuffled}}) {
    RaySet a = make(ordered), b = make(mixed);
    EXPECT_NE(a.rows, b.rows);
    std::sort(a.rows.begin(), a.rows.end());
    std::sort(b.rows.begin(), b.rows.end());
    EXPECT_EQ(a.rows, b.rows);
  }
}

TEST_F(RaySets, BouncesStartOutsideOfTheSurface) {
  // A closed body seen from outside: a ray that started below its surface would hit it from within at once.
  const auto hits = scene::intersect(*scene_, make(RaySetKind::kDiffuse).batch(), {});
  const auto count = std::count(hits->status.begin(), hits->status.end(), RayStatus::kHit);
  EXPECT_LT(count, std::ptrdiff_t(kRays / 2));
}

TEST_F(RaySets, OcclusionRaysReachFivePercentOfTheDiagonal) {
  const double reach = 0.05 * glm::length(scene_->bounds().extent());
  for (const auto& row : make(RaySetKind::kAo).rows) {
    const double length = glm::length(Vec3d{row[4], row[5], row[6]}) * double(row[7]);
    ASSERT_NEAR(length, reach, 1e-3 * reach);
  }
}

TEST_F(RaySets, ACameraThatSeesNothingIsAnErrorForBounces) {
  View away = bench_.view;
  away.target = away.eye + (away.eye - bench_.view.target);
  const RaySetMaker maker(*scene_, away, 100, 1);
  EXPECT_TRUE(maker.make(RaySetKind::kPrimary));
  EXPECT_FALSE(maker.make(RaySetKind::kAo));
}

TEST(RaySetsOfTheHall, TheLightIsSeenFromSomeOfWhatTheCameraSees) {
  const BenchScene hall = make_scene("S4", 5, 0.05).value();
  const auto scene = scene::build_scene(hall.data).value();
  const RaySetMaker maker(*scene, hall.view, 2000, 5);
  const auto dark = scene::occluded(*scene, maker.make(RaySetKind::kShadow)->batch(), {});
  const auto count = std::count(dark->begin(), dark->end(), RayStatus::kHit);
  EXPECT_GT(count, 200);
  EXPECT_LT(count, 1800);
}

TEST(RaySetNames, AnUnknownOneIsAnError) {
  EXPECT_FALSE(parse_ray_set("bounce"));
}

}  // namespace
}  // namespace gridcast::measure
