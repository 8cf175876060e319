#include "core/blas/spatial_split.h"

#include <cstring>

#include <gtest/gtest.h>
#include <oneapi/tbb/task_arena.h>

#include "core/blas/bvh_builder.h"
#include "core/blas/triangle_cover.h"
#include "core/blas/wide_bvh.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

/// Long diagonal needles among small triangles: what plain boxes are bad at.
TriangleMesh thicket(int needles, std::uint64_t seed) {
  TriangleMesh mesh = test::soup(needles, seed, 0.02F);
  Random random(seed + 1);
  for (int i = 0; i < needles; ++i) {
    const Vec3f from(random.in_box(1.0)), to(random.in_box(1.0)), width(random.in_box(0.002));
    const auto first = std::uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {from, to, to + width});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

StructureStats stats_of(const std::shared_ptr<const TriangleMesh>& mesh, SpatialSplits spatial) {
  return Blas::build(mesh, {.kind = StructureKind::kWideBvh, .spatial = spatial}).value().stats();
}

TEST(SpatialSplit, both_parts_of_a_cut_triangle_contain_what_lies_on_their_side) {
  Random random(test::seed_or(61));
  for (int i = 0; i < 3000; ++i) {
    const double scale = std::pow(10.0, random.uniform(-25.0, 15.0));
    const Vec3d offset = random.below(2) == 0 ? Vec3d(0.0) : 100.0 * random.in_box(scale);
    std::array<Vec3f, 3> corners;
    Bounds3f whole;
    for (Vec3f& corner : corners) whole.extend(corner = Vec3f(offset + random.in_box(scale)) + 0.F);
    const auto axis = int(random.below(3));
    const float plane = whole.lower[axis] + float(random.uniform()) * (whole.upper[axis] - whole.lower[axis]);
    const CutReference cut = cut_reference(corners, to_box4(whole), axis, plane);
    const Bounds3f left = cut.left.bounds(), right = cut.right.bounds();
    ASSERT_TRUE(whole.contains(left) && whole.contains(right));
    ASSERT_TRUE(left.empty() || left.upper[axis] <= plane);
    ASSERT_TRUE(right.empty() || right.lower[axis] >= plane);
    for (int k = 0; k < 20; ++k) {
      const double s = random.uniform(), t = random.uniform() * (1.0 - s);
      const Vec3d a(corners[0]), b(corners[1]), c(corners[2]);
      const Vec3d p = a + s * (b - a) + t * (c - a);
      const Bounds3d box = to_double(p[axis] <= double(plane) ? left : right);
      const double rounding = 1e-14 * max_abs(p);  // of p itself
      const Bounds3d wider{box.lower - rounding, box.upper + rounding};
      ASSERT_TRUE(wider.contains(p)) << "cut " << i;
    }
  }
}

TEST(SpatialSplit, a_cut_part_is_cut_again_within_its_box) {
  const std::array<Vec3f, 3> corners{Vec3f(0, 0, 0), Vec3f(8, 8, 0), Vec3f(8, 9, 0)};
  const Box4 whole = to_box4({{0, 0, 0}, {8, 9, 0}});
  const CutReference first = cut_reference(corners, whole, 0, 4.F);
  const CutReference second = cut_reference(corners, first.right, 0, 6.F);
  const Bounds3f middle = second.left.bounds();
  EXPECT_EQ(middle.lower.x, 4.F);
  EXPECT_EQ(middle.upper.x, 6.F);
  EXPECT_NEAR(middle.lower.y, 4.F, 1e-4F);
  EXPECT_NEAR(middle.upper.y, 6.75F, 1e-4F);
}

TEST(SpatialSplit, overlapping_needles_are_split_and_the_tree_costs_less) {
  const auto mesh = test::share(thicket(20000, test::seed_or(62)));
  const StructureStats whole = stats_of(mesh, SpatialSplits::kNever);
  const StructureStats split = stats_of(mesh, SpatialSplits::kAuto);
  EXPECT_EQ(whole.reference_count, mesh->triangle_count());
  EXPECT_GT(split.reference_count, mesh->triangle_count() * 11 / 10);
  EXPECT_LE(double(split.reference_count), kMaxReferenceGrowth * double(mesh->triangle_count()));
  EXPECT_LT(split.cost, 0.95 * whole.cost);
}

TEST(SpatialSplit, smooth_surfaces_are_left_alone) {
  for (const TriangleMesh& mesh : {test::icosphere(6), test::quad_grid(200), test::torus(300, 200)}) {
    const auto shared = test::share(mesh);
    EXPECT_LE(stats_of(shared, SpatialSplits::kAuto).reference_count, mesh.triangle_count() * 102 / 100);
  }
}

TEST(SpatialSplit, answers_are_those_of_whole_triangles) {
  const auto mesh = test::share(thicket(3000, test::seed_or(63)));
  const Blas split = Blas::build(mesh, {.kind = StructureKind::kWideBvh}).value();
  const Blas brute_force = Blas::build(mesh, {.kind = StructureKind::kBruteForce}).value();
  ASSERT_GT(split.stats().reference_count, mesh->triangle_count());
  const Status status = split.validate();
  ASSERT_TRUE(status.ok()) << status.error().where << " " << status.error().message;
  RayMaker maker(*mesh, test::seed_or(64));
  for (int i = 0; i < 1500; ++i) {
    const RayCase ray = maker.any();
    const Hit want = closest<Precision::kRobust>(brute_force, ray),
              got = closest<Precision::kRobust>(split, ray);
    ASSERT_TRUE(want.t == got.t && want.u == got.u && want.v == got.v &&
                want.primitive_id == got.primitive_id)
        << "ray " << i;
    ASSERT_EQ(any<Precision::kRobust>(split, ray), want.valid()) << "ray " << i;
    const Hit fast = closest<Precision::kFast>(split, ray),
              slow = closest<Precision::kFast>(brute_force, ray);
    ASSERT_TRUE(fast.t == slow.t && fast.primitive_id == slow.primitive_id) << "ray " << i;
  }
}

TEST(SpatialSplit, a_refit_gives_every_leaf_whole_triangles_and_stays_right) {
  const auto mesh = test::share(thicket(3000, test::seed_or(65)));
  const Blas split = Blas::build(mesh, {.kind = StructureKind::kWideBvh}).value();
  ASSERT_GT(split.stats().reference_count, mesh->triangle_count());
  const Blas refitted = split.refit(mesh).value();
  EXPECT_TRUE(refitted.validate().ok());
  EXPECT_GT(refitted.stats().cost, split.stats().cost);
  RayMaker maker(*mesh, test::seed_or(66));
  for (int i = 0; i < 500; ++i) {
    const RayCase ray = maker.any();
    ASSERT_EQ(closest<Precision::kRobust>(split, ray).t, closest<Precision::kRobust>(refitted, ray).t);
  }
}

TEST(SpatialSplit, the_tree_does_not_depend_on_the_number_of_threads) {
  const TriangleMesh mesh = thicket(40000, test::seed_or(67));
  std::shared_ptr<const WideBvh> one, four;
  oneapi::tbb::task_arena(1).execute([&] { one = WideBvh::build(mesh, {}, {}).value(); });
  oneapi::tbb::task_arena(4).execute([&] { four = WideBvh::build(mesh, {}, {}).value(); });
  ASSERT_EQ(one->nodes().size(), four->nodes().size());
  ASSERT_EQ(one->blocks().size(), four->blocks().size());
  EXPECT_EQ(std::memcmp(one->nodes().data(), four->nodes().data(), one->nodes().size() * sizeof(WideNode)),
            0);
  EXPECT_EQ(
      std::memcmp(one->blocks().data(), four->blocks().data(), one->blocks().size() * sizeof(TriangleBlock)),
      0);
}

TEST(TriangleCover, boxes_that_leave_a_gap_are_found) {
  const std::array<Vec3f, 3> corners{Vec3f(0, 0, 0), Vec3f(4, 0, 4), Vec3f(0, 4, 4)};
  const Bounds3f left{{0, 0, 0}, {1, 4, 4}}, right{{1, 0, 0}, {4, 3, 4}}, late{{1.001F, 0, 0}, {4, 3, 4}};
  EXPECT_TRUE(covers(std::array{left, right}, corners));
  EXPECT_TRUE(covers(std::array{right, left, right}, corners));
  EXPECT_FALSE(covers(std::array{left, late}, corners));
  EXPECT_FALSE(covers(std::array{left}, corners));
  EXPECT_FALSE(covers({}, corners));

  const std::array<Vec3f, 3> flat{Vec3f(0, 2, 0), Vec3f(4, 2, 4), Vec3f(0, 2, 4)};
  EXPECT_TRUE(covers(std::array{Bounds3f{{0, 2, 0}, {2, 2, 4}}, Bounds3f{{2, 2, 0}, {4, 2, 4}}}, flat));
  EXPECT_FALSE(covers(std::array{Bounds3f{{0, 2, 0}, {2, 2, 4}}, Bounds3f{{2, 2.01F, 0}, {4, 3, 4}}}, flat));
}

}  // namespace
}  // namespace gridcast::blas
