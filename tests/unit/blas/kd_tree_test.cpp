#include "core/blas/kd_tree.h"

#include <cmath>
#include <cstring>
#include <string>

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include "core/blas/kd_tree_clip.h"
#include "core/blas/kd_tree_split.h"
#include "core/mesh/triangle_test.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::blas {
namespace {

using mesh::TriangleMesh;
using test::Random;

KdLayout built(const TriangleMesh& mesh) {
  return KdTree::build(mesh, {}).value()->layout();
}

StructureStats stats_of(const TriangleMesh& mesh) {
  StructureStats stats;
  KdTree::build(mesh, {}).value()->add_stats(stats);
  return stats;
}

template <class Column>
bool same_bits(const Column& a, const Column& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
}
bool same(const KdLayout& a, const KdLayout& b) {
  return same_bits(a.treelets, b.treelets) && same_bits(a.blocks, b.blocks) &&
         same_bits(a.triangles, b.triangles);
}

Status validity(const TriangleMesh& mesh) {
  return validate_kd_tree(built(mesh), mesh);
}

/// `mesh` and then `more` in one.
TriangleMesh joined(TriangleMesh mesh, const TriangleMesh& more) {
  const auto first = std::uint32_t(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), more.positions.begin(), more.positions.end());
  for (const auto& [a, b, c] : more.triangles) mesh.triangles.push_back({a + first, b + first, c + first});
  return mesh;
}

/// One ray against testing every triangle.
void expect_brute_force(const KdTree& tree, const TriangleMesh& mesh, const Ray& ray) {
  mesh::ObjectRay prepared;
  if (!is_valid(ray) || !prepared.prepare(ray, mesh.bounds())) return;
  Hit expected;
  Hit found;
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    const auto [p0, p1, p2] = mesh.corners(id);
    mesh::intersect_primitive<Precision::kRobust>(prepared, p0, p1, p2, id, expected);
  }
  ClosestHit closest{found};
  tree.intersect<Precision::kRobust>(mesh, prepared, closest);
  ASSERT_EQ(found.primitive_id, expected.primitive_id);
  ASSERT_EQ(found.t, expected.t);
  AnyHit any{Hit().t};
  ASSERT_EQ(tree.intersect<Precision::kRobust>(mesh, prepared, any), expected.primitive_id != kInvalidId);
}

/// Rays through the box, each along an axis or free, some exactly through corners: equal to testing all
/// triangles.
void expect_hits_of_brute_force(const TriangleMesh& mesh, int rays) {
  const auto tree = KdTree::build(mesh, {}).value();
  Random random(test::seed_or(5));
  const Bounds3d bounds = to_double(mesh.bounds());
  for (int i = 0; i < rays; ++i) {
    Ray ray{bounds.center() + max_abs(bounds.extent()) * random.in_box(1.0), random.direction()};
    const auto corner = Vec3d(mesh.corners(random.below(std::uint32_t(mesh.triangle_count())))[0]);
    if (i % 3 == 0) ray.direction = corner - ray.origin;
    if (i % 3 == 1) {
      const auto axis = int(random.below(3));
      ray = {corner, Vec3d(0.0)};
      ray.origin[axis] -= 2.0;
      ray.direction[axis] = 1.0;
    }
    SCOPED_TRACE("ray " + std::to_string(i));
    expect_brute_force(*tree, mesh, ray);
    if (testing::Test::HasFatalFailure()) return;
  }
}

TEST(KdTreeClip, the_box_of_a_clipped_triangle_is_tight_and_exact_for_small_integers) {
  const std::array<Vec3f, 3> corners{Vec3f(0, 0, 5), Vec3f(8, 0, 5), Vec3f(0, 8, 5)};
  const auto box = clip_triangle(corners, {{2, 4, 0}, {9, 9, 9}});
  ASSERT_TRUE(box.has_value());
  EXPECT_EQ(box->lower, Vec3f(2, 4, 5));
  EXPECT_EQ(box->upper.z, 5.F) << "an axis-aligned triangle stays flat";
  EXPECT_NEAR(box->upper.x, 4.F, 1e-5F);
  EXPECT_NEAR(box->upper.y, 6.F, 1e-5F);
  EXPECT_FALSE(clip_triangle(corners, {{5, 5, 0}, {9, 9, 9}}).has_value());
}

TEST(KdTreeClip, every_point_of_the_triangle_in_the_cell_is_in_the_box) {
  Random random(test::seed_or(6));
  for (int i = 0; i < 20000; ++i) {
    // Small integers over eight: sums of eighths are exact, so is membership in the cell.
    auto coordinate = [&] { return float(random.below(33)) / 8.F; };
    auto point = [&] { return Vec3f(coordinate(), coordinate(), coordinate()); };
    const std::array<Vec3f, 3> corners{point(), point(), point()};
    Bounds3f cell;
    cell.extend(point());
    cell.extend(point());
    const auto box = clip_triangle(corners, cell);
    for (int u = 0; u <= 8; ++u) {
      for (int v = 0; u + v <= 8; ++v) {
        const Vec3f p = (float(8 - u - v) * corners[0] + float(u) * corners[1] + float(v) * corners[2]) / 8.F;
        if (!cell.contains(p)) continue;
        ASSERT_TRUE(box.has_value()) << "triangle " << i;
        ASSERT_TRUE(box->contains(p)) << "triangle " << i;
      }
    }
  }
}

TEST(KdTreeBuild, trees_of_all_shapes_are_valid_and_within_their_limits) {
  const std::vector<TriangleMesh> meshes = {test::single_triangle(),
                                            test::icosphere(4),
                                            test::soup(3000, 1, 0.2F),
                                            test::quad_grid(40),
                                            test::slivers(500, 2, 1e6F),
                                            test::needle_fan(2000),
                                            test::repeated(test::icosphere(1), 50)};
  for (const TriangleMesh& mesh : meshes) {
    const Status valid = validity(mesh);
    EXPECT_TRUE(valid.ok()) << valid.error().message << " " << valid.error().where;
    const StructureStats stats = stats_of(mesh);
    EXPECT_LE(stats.reference_count, kMaxReferencesPerTriangle * mesh.triangle_count() + 64);
    EXPECT_LE(stats.max_depth, kMaxKdDepth);
    EXPECT_GE(stats.reference_count, stats.leaf_count);
  }
}

TEST(KdTreeBuild, the_tree_does_not_depend_on_the_number_of_threads) {
  const TriangleMesh mesh = test::soup(20000, 8, 0.05F);
  const KdLayout many = built(mesh);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_TRUE(same(many, built(mesh)));
}

TEST(KdTreeBuild, a_build_that_is_stopped_gives_cancelled) {
  std::stop_source stop;
  stop.request_stop();
  const auto result = KdTree::build(test::icosphere(3), stop.get_token());
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::kCancelled);
}

TEST(KdTreeBuild, a_hundred_thousand_equal_triangles_make_one_full_leaf_not_copies) {
  const TriangleMesh mesh = test::repeated(test::single_triangle(), 100000);
  EXPECT_EQ(stats_of(mesh).reference_count, mesh.triangle_count());
  expect_hits_of_brute_force(mesh, 20);
}

TEST(KdTreeBuild, a_hundred_thousand_triangles_of_one_middle_stay_within_their_limits) {
  TriangleMesh mesh;
  Random random(test::seed_or(10));
  for (int k = 0; k < 100000; ++k) {
    const auto first = std::uint32_t(mesh.positions.size());
    const auto a = Vec3f(random.in_box(1.0));
    const auto b = Vec3f(random.in_box(1.0));
    mesh.positions.insert(mesh.positions.end(), {a, b, -a - b});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  const StructureStats stats = stats_of(mesh);
  EXPECT_LE(stats.max_depth, kMaxKdDepth);
  EXPECT_LE(stats.reference_count, kMaxReferencesPerTriangle * mesh.triangle_count() + 64);
  expect_hits_of_brute_force(mesh, 20);
}

TEST(KdTreeBuild, triangles_that_shrink_geometrically_stay_within_the_stack) {
  for (const int count : {2000, 100000}) {
    TriangleMesh mesh;
    for (int k = 0; k < count; ++k) {
      const float size = std::ldexp(1.F, -(k % 120));
      const auto first = std::uint32_t(mesh.positions.size());
      mesh.positions.insert(mesh.positions.end(), {{size, 0, 0}, {0, size, 0}, {0, 0, size}});
      mesh.triangles.push_back({first, first + 1, first + 2});
    }
    EXPECT_LE(stats_of(mesh).max_depth, kMaxKdDepth);
    if (count == 2000) {
      EXPECT_TRUE(validity(mesh).ok());
    }
    expect_hits_of_brute_force(mesh, 30);
  }
}

TEST(KdTreeBuild, empty_space_between_far_meshes_is_cut_off) {
  const TriangleMesh sphere = test::icosphere(3);
  const TriangleMesh mesh = joined(sphere, test::translated(sphere, {100, 0, 0}));
  const StructureStats stats = stats_of(mesh);
  EXPECT_LT(stats.cost, 0.05 * double(mesh.triangle_count()));
  EXPECT_TRUE(validity(mesh).ok());
}

TEST(KdTreeTraversal, triangles_in_the_split_planes_are_hit) {
  TriangleMesh mesh;
  for (int i = 0; i < 400; ++i) {
    const Vec3f lower(float(i % 20), 0.F, float(i / 20));
    mesh = joined(mesh, test::box(lower, lower + Vec3f(1.F, float(1 + i % 7), 1.F)));
  }
  EXPECT_TRUE(validity(mesh).ok());
  expect_hits_of_brute_force(mesh, 1000);
}

TEST(KdTreeTraversal, a_sheet_of_triangles_between_others_goes_to_one_side_and_is_hit) {
  // Soup on both sides of a grid in its middle plane, that plane the cheapest to split at.
  TriangleMesh mesh = test::translated(test::quad_grid(12, 2.F), {-1, -1, 0});
  mesh = joined(mesh, test::translated(test::soup(300, 21, 0.1F), {0, 0, 1.5F}));
  mesh = joined(mesh, test::translated(test::soup(300, 22, 0.1F), {0, 0, -1.5F}));
  mesh = joined(mesh, test::repeated(test::translated(test::quad_grid(2, 2.F), {-1, -1, 0}), 30));
  const Status valid = validity(mesh);
  EXPECT_TRUE(valid.ok()) << valid.error().message << " " << valid.error().where;
  expect_hits_of_brute_force(mesh, 600);
}

TEST(KdTreeTraversal, rays_that_start_on_split_planes_or_run_in_them_equal_brute_force) {
  const TriangleMesh mesh = joined(test::box({-1, -1, -1}, {1, 1, 1}), test::soup(2000, 23, 0.2F));
  const auto tree = KdTree::build(mesh, {}).value();
  Random random(test::seed_or(24));
  for (const KdTreelet& treelet : tree->layout().treelets) {
    for (std::uint32_t i = 0; i < KdTreelet::kPlanes; ++i) {
      if (std::isinf(treelet.planes[i])) continue;
      const int axis = treelet.axis(i);
      Ray ray{random.in_box(1.0), random.direction()};
      ray.origin[axis] = double(treelet.planes[i]);
      const auto kind = random.below(3);
      if (kind == 0) ray.direction[axis] = random.below(2) == 0 ? 0.0 : -0.0;
      if (kind == 1) {
        ray.direction = Vec3d(0.0);
        ray.direction[int(random.below(3))] = random.below(2) == 0 ? 1.0 : -1.0;
      }
      SCOPED_TRACE("plane " + std::to_string(treelet.planes[i]));
      expect_brute_force(*tree, mesh, ray);
      if (HasFatalFailure()) return;
    }
  }
}

TEST(KdTreeTraversal, slivers_cut_into_perfect_parts_equal_brute_force) {
  for (const float aspect : {1e3F, 1e5F, 1e7F}) {
    const TriangleMesh mesh = test::slivers(1500, 25, aspect);
    const Status valid = validity(mesh);
    EXPECT_TRUE(valid.ok()) << valid.error().message << " " << valid.error().where;
    expect_hits_of_brute_force(mesh, 300);
  }
}

TEST(KdTreeTraversal, a_treelet_finds_its_children_and_blocks) {
  KdTreelet treelet{};
  treelet.used = 0xFF;
  treelet.inner = 0b01010010;
  treelet.first_treelet = 100;
  treelet.first_block = 1000;
  std::uint32_t blocks = 0, children = 0;
  for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
    if (treelet.is_inner(slot)) {
      EXPECT_EQ(treelet.child(slot), 100 + children++);
      continue;
    }
    EXPECT_EQ(treelet.block(slot), 1000 + blocks);
    treelet.block_counts |= KdTreelet::kMaxBlocks << (4 * slot);
    EXPECT_EQ(treelet.block_count(slot), KdTreelet::kMaxBlocks);
    blocks += KdTreelet::kMaxBlocks;
  }
}

TEST(KdTreeTraversal, flat_and_binned_scenes_equal_brute_force) {
  expect_hits_of_brute_force(test::quad_grid(60), 300);
  expect_hits_of_brute_force(test::soup(20 * int(kExactSplits), 3, 0.02F), 300);
}

}  // namespace
}  // namespace gridcast::blas
