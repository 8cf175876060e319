#include "core/blas/embree_tree.h"

#include <array>
#include <cstddef>
#include <memory>
#include <new>

#include <gtest/gtest.h>
#include <oneapi/tbb/parallel_for.h>

#include "core/mesh/triangle_test.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::blas {
namespace {

using mesh::TriangleMesh;
using test::Random;

/// Closest hit by the tree and by testing all triangles.
struct Answers {
  Hit tree, all;
};

Answers trace(const EmbreeTree& tree, const TriangleMesh& mesh, const Ray& ray) {
  Answers answers;
  answers.tree.t = answers.all.t = ray.tfar;
  mesh::ObjectRay prepared;
  if (!prepared.prepare(ray, mesh.bounds())) return answers;
  ClosestHit closest{answers.tree};
  tree.intersect<Precision::kRobust>(mesh, prepared, closest);
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    const auto [p0, p1, p2] = mesh.corners(id);
    mesh::intersect_primitive<Precision::kRobust>(prepared, p0, p1, p2, id, answers.all);
  }
  return answers;
}

TEST(EmbreeTree, rays_from_any_distance_get_the_hits_of_brute_force) {
  const TriangleMesh mesh = test::jittered_icosphere(3, 4);
  const auto tree = EmbreeTree::build(mesh, {}).value();
  Random random(test::seed_or(9));
  int hits = 0;
  for (int exponent = -10; exponent <= 60; exponent += 2) {
    for (int i = 0; i < 30; ++i) {
      const Vec3d from = std::ldexp(1.0, exponent) * random.direction();
      const auto [found, expected] = trace(*tree, mesh, {from, random.in_box(0.5) - from});
      ASSERT_EQ(found.primitive_id, expected.primitive_id) << "from 2^" << exponent;
      ASSERT_EQ(found.t, expected.t);
      hits += int(expected.valid());
    }
  }
  EXPECT_GT(hits, 500);
}

TEST(EmbreeTree, zero_and_tiny_direction_components_of_either_sign_lose_nothing) {
  // Embree turns components below 1e-18 into +1e-18; rays run in the faces and edges of the box.
  const TriangleMesh mesh = test::box({0, 0, 0}, {1, 1, 1});
  const auto tree = EmbreeTree::build(mesh, {}).value();
  for (const double small : {0.0, -0.0, 1e-300, -1e-300, 1e-19, -1e-19, 1e-17, -1e-17}) {
    for (const double x : {0.0, 0.5, 1.0}) {
      for (const double y : {0.0, 0.5, 1.0}) {
        for (int axis = 0; axis < 3; ++axis) {
          Ray ray{Vec3d(0.0), Vec3d(small)};
          ray.origin[axis] = -3.0;
          ray.origin[(axis + 1) % 3] = x;
          ray.origin[(axis + 2) % 3] = y;
          ray.direction[axis] = 1.0;
          const auto [found, expected] = trace(*tree, mesh, ray);
          EXPECT_EQ(found.primitive_id, expected.primitive_id) << small << " " << x << " " << y;
        }
      }
    }
  }
}

TEST(EmbreeTree, ranges_that_begin_behind_the_origin_are_searched) {
  const TriangleMesh mesh = test::icosphere(2);
  const auto tree = EmbreeTree::build(mesh, {}).value();
  for (const double tnear : {-1e300, -10.0, -std::numeric_limits<double>::infinity()}) {
    const auto [found, expected] = trace(*tree, mesh, {{0.01, 0.02, 5.0}, {0.0, 0.0, 1.0}, tnear, 0.0});
    ASSERT_TRUE(expected.valid());
    EXPECT_EQ(found.t, expected.t);
  }
}

TEST(EmbreeTree, meshes_at_both_ends_of_the_coordinate_range_get_the_hits_of_brute_force) {
  Random random(test::seed_or(10));
  for (const float radius : {1e-30F, 1e-10F, 1e10F, 0.9e18F}) {
    const TriangleMesh mesh = test::icosphere(2, radius);
    const auto tree = EmbreeTree::build(mesh, {}).value();
    for (int i = 0; i < 100; ++i) {
      const Vec3d from = 3.0 * double(radius) * random.direction();
      const auto [found, expected] = trace(*tree, mesh, {from, double(radius) * random.in_box(0.5) - from});
      ASSERT_TRUE(expected.valid());
      EXPECT_EQ(found.primitive_id, expected.primitive_id) << radius;
      EXPECT_EQ(found.t, expected.t);
    }
  }
}

TEST(EmbreeTree, building_and_tracing_leave_denormals_alone) {
  const TriangleMesh mesh = test::icosphere(4);
  auto denormals_work = [] {
    volatile double smallest = std::numeric_limits<double>::denorm_min();
    return smallest * 4.0 != 0.0;
  };
  tbb::parallel_for(0, 8, [&](int) {
    const auto tree = EmbreeTree::build(mesh, {}).value();
    EXPECT_TRUE(denormals_work());
    trace(*tree, mesh, {{0, 0, 3}, {0, 0, -1}});
    EXPECT_TRUE(denormals_work());
  });
}

// Embree's scene would remember the context of the task that built it, which oneTBB then reads.
TEST(EmbreeTree, a_tree_built_by_a_task_that_is_gone_does_not_disturb_what_is_cancelled_later) {
  using tbb::task_group_context;
  const TriangleMesh mesh = test::icosphere(2);
  const auto once = [](task_group_context& context, const auto& work) {
    tbb::parallel_for(
        0, 1, [&](int) { work(); }, tbb::simple_partitioner(), context);
  };
  alignas(task_group_context) std::array<std::byte, sizeof(task_group_context)> memory;
  auto* const gone = new (memory.data()) task_group_context(task_group_context::isolated);
  std::shared_ptr<const EmbreeTree> tree;
  once(*gone, [&] { tree = EmbreeTree::build(mesh, {}).value(); });
  gone->~task_group_context();
  memory.fill(std::byte{0x11});

  task_group_context cancelled(task_group_context::isolated);
  once(cancelled, [&] {
    task_group_context child;
    once(child, [&] { EXPECT_TRUE(cancelled.cancel_group_execution()); });
    EXPECT_TRUE(child.is_group_execution_cancelled());
  });
  ASSERT_NE(tree, nullptr);
  EXPECT_EQ(trace(*tree, mesh, {{0.1, 0.2, 3.0}, {0.0, 0.0, -1.0}}).tree.valid(), true);
}

TEST(EmbreeTree, a_build_that_is_stopped_gives_cancelled) {
  std::stop_source stop;
  stop.request_stop();
  const auto result = EmbreeTree::build(test::icosphere(5), stop.get_token());
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
}

TEST(EmbreeTree, a_hundred_thousand_equal_triangles_build_and_the_first_wins) {
  const TriangleMesh mesh = test::repeated(test::single_triangle(), 100000);
  const auto tree = EmbreeTree::build(mesh, {}).value();
  mesh::ObjectRay ray;
  ASSERT_TRUE(ray.prepare({{0.25, 0.25, 1.0}, {0.0, 0.0, -1.0}}, mesh.bounds()));
  Hit best;
  ClosestHit closest{best};
  ASSERT_TRUE(tree->intersect<Precision::kRobust>(mesh, ray, closest));
  EXPECT_EQ(best.primitive_id, 0U);
}

TEST(EmbreeTree, validation_passes_for_its_mesh_and_fails_for_another) {
  const TriangleMesh mesh = test::icosphere(3);
  const auto tree = EmbreeTree::build(mesh, {}).value();
  EXPECT_TRUE(tree->validate(mesh).ok());
  EXPECT_FALSE(tree->validate(test::icosphere(2)).ok());
  EXPECT_FALSE(tree->validate(test::icosphere(3, 2.F)).ok());
  TriangleMesh one_moved = mesh;
  for (const std::uint32_t vertex : one_moved.triangles[500]) one_moved.positions[vertex] *= 0.3F;
  const Status status = tree->validate(one_moved);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().where.substr(0, 11), "/triangles/");
}

TEST(EmbreeTree, memory_is_counted) {
  StructureStats stats;
  EmbreeTree::build(test::icosphere(4), {}).value()->add_stats(stats);
  EXPECT_EQ(stats.reference_count, 5120U);
  EXPECT_GT(stats.memory_bytes, 5120U * 16U);
}

}  // namespace
}  // namespace gridcast::blas
