#include "core/blas/blas.h"

#include <gtest/gtest.h>

#include "core/blas/brute_force.h"
#include "core/blas/cost_model.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

TEST(Blas, auto_takes_brute_force_for_a_handful_of_triangles_and_says_why) {
  const TriangleMesh triangle = test::single_triangle();
  const auto few = test::share(test::repeated(triangle, int(kBruteForceTriangles)));
  const auto more = test::share(test::repeated(triangle, int(kBruteForceTriangles) + 1));
  const Blas small = Blas::build(few, {}).value();
  const Blas large = Blas::build(more, {}).value();
  EXPECT_EQ(small.stats().kind, StructureKind::kBruteForce);
  EXPECT_EQ(large.stats().kind, StructureKind::kWideBvh);
  EXPECT_NE(small.stats().reason.find('4'), std::string::npos) << small.stats().reason;
  EXPECT_NE(large.stats().reason.find('5'), std::string::npos) << large.stats().reason;
}

TEST(Blas, auto_takes_a_kd_tree_where_boxes_overlap_but_not_when_the_mesh_deforms) {
  const auto slivers = test::share(test::slivers(8000, 4, 1000.F));
  const Blas still = Blas::build(slivers, {}).value();
  EXPECT_EQ(still.stats().kind, StructureKind::kKdTree) << still.stats().reason;
  EXPECT_NE(still.stats().reason.find("overlap"), std::string::npos) << still.stats().reason;
  EXPECT_LT(still.stats().cost, Blas::build(slivers, {StructureKind::kWideBvh}).value().stats().cost);
  EXPECT_FALSE(still.can_refit());

  BuildOptions moving;
  moving.motion = MeshMotion::kDeforms;
  const Blas deforming = Blas::build(slivers, moving).value();
  EXPECT_EQ(deforming.stats().kind, StructureKind::kWideBvh) << deforming.stats().reason;
  EXPECT_NE(deforming.stats().reason.find("deforms"), std::string::npos) << deforming.stats().reason;
}

TEST(Blas, auto_takes_the_wide_bvh_where_surfaces_are_connected) {
  for (const TriangleMesh& mesh : {test::icosphere(4), test::torus(40, 30), test::quad_grid(30)}) {
    const Blas blas = Blas::build(test::share(mesh), {}).value();
    EXPECT_EQ(blas.stats().kind, StructureKind::kWideBvh) << blas.stats().reason;
  }
}

TEST(Blas, a_kind_that_was_asked_for_is_built_whatever_the_size) {
  const auto mesh = test::share(test::single_triangle());
  const Blas blas = Blas::build(mesh, {StructureKind::kBvh}).value();
  EXPECT_EQ(blas.stats().kind, StructureKind::kBvh);
  EXPECT_EQ(blas.options().kind, StructureKind::kBvh);
  EXPECT_EQ(blas.mesh_ptr(), mesh);
}

TEST(Blas, statistics_describe_the_structure) {
  const auto mesh = test::share(test::icosphere(3));
  const StructureStats stats = Blas::build(mesh, {StructureKind::kBvh}).value().stats();
  EXPECT_EQ(stats.triangle_count, 1280U);
  EXPECT_EQ(stats.reference_count, 1280U);
  EXPECT_GT(stats.node_count, 600U);
  EXPECT_GT(stats.memory_bytes, stats.node_count * 32);
  EXPECT_GT(stats.cost, 1.0);
  EXPECT_LT(stats.cost, 100.0);
  EXPECT_EQ(stats.cost, stats.cost_at_build);
}

TEST(Blas, brute_force_costs_a_test_per_triangle_and_notices_another_mesh) {
  const TriangleMesh mesh = test::icosphere(1);
  const auto brute_force = BruteForce::build(mesh, {}).value();
  StructureStats stats;
  brute_force->add_stats(stats);
  EXPECT_EQ(stats.cost, 80.0);
  EXPECT_TRUE(brute_force->validate(mesh).ok());
  EXPECT_FALSE(brute_force->validate(test::icosphere(2)).ok());
}

TEST(Blas, names_are_read_back) {
  for (const StructureKind kind :
       {StructureKind::kAuto, StructureKind::kBruteForce, StructureKind::kBvh, StructureKind::kWideBvh,
        StructureKind::kKdTree, StructureKind::kEmbree, StructureKind::kCompactBvh})
    EXPECT_EQ(parse_structure_kind(to_string(kind)).value(), kind);
  for (const BvhSplit split : {BvhSplit::kMidpoint, BvhSplit::kMedian, BvhSplit::kBinnedSah})
    EXPECT_EQ(parse_bvh_split(to_string(split)).value(), split);
  for (const SpatialSplits spatial : {SpatialSplits::kAuto, SpatialSplits::kNever})
    EXPECT_EQ(parse_spatial_splits(to_string(spatial)).value(), spatial);
  EXPECT_FALSE(parse_spatial_splits("always").ok());
  for (const BuildQuality quality : {BuildQuality::kDefault, BuildQuality::kFast})
    EXPECT_EQ(parse_build_quality(to_string(quality)).value(), quality);
  EXPECT_FALSE(parse_build_quality("best").ok());
}

TEST(Blas, an_unknown_name_is_answered_with_the_known_ones) {
  const auto kind = parse_structure_kind("octree");
  ASSERT_FALSE(kind.ok());
  EXPECT_EQ(kind.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(kind.error().message,
            "'octree' is not a structure; valid names: auto, brute_force, bvh, wide_bvh, compact_bvh, "
            "kd_tree, embree");
  const auto split = parse_bvh_split("");
  ASSERT_FALSE(split.ok());
  EXPECT_EQ(split.error().message, "'' is not a BVH split; valid names: midpoint, median, sah");
}

TEST(Blas, a_refit_names_what_does_not_match) {
  const auto mesh = test::share(test::icosphere(2));
  for (const StructureKind kind : {StructureKind::kBruteForce, StructureKind::kBvh}) {
    const Blas blas = Blas::build(mesh, {kind}).value();
    EXPECT_TRUE(blas.can_refit());

    const auto finer = blas.refit(test::share(test::icosphere(3)));
    ASSERT_FALSE(finer.ok());
    EXPECT_EQ(finer.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(finer.error().where, "/triangles");

    TriangleMesh rewired = *mesh;
    ++rewired.topology_version;
    const auto other = blas.refit(test::share(rewired));
    ASSERT_FALSE(other.ok());
    EXPECT_EQ(other.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(other.error().where, "/topology_version");
  }
}

TEST(Blas, a_refit_leaves_the_old_one_answering_as_before) {
  const auto mesh = test::share(test::icosphere(2));
  const RayCase ray{{{0, 0, -5}, {0, 0, 1}}};
  const Blas before = Blas::build(mesh, {StructureKind::kBvh}).value();
  const double t = closest<Precision::kRobust>(before, ray).t;
  const Blas after = before.refit(test::share(test::translated(*mesh, {0, 0, 1}))).value();
  EXPECT_EQ(closest<Precision::kRobust>(before, ray).t, t);
  EXPECT_NEAR(closest<Precision::kRobust>(after, ray).t, t + 1.0, 1e-6);
  EXPECT_EQ(after.bounds(), after.mesh().bounds());
}

}  // namespace
}  // namespace gridcast::blas
