#include "core/blas/kd_tree.h"

#include <cstring>

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

KdTreeData built(const TriangleMesh& mesh) {
  return KdTree::build(mesh, {}).value()->data();
}

StructureStats stats_of(const TriangleMesh& mesh) {
  StructureStats stats;
  KdTree::build(mesh, {}).value()->add_stats(stats);
  return stats;
}

bool same(const KdTreeData& a, const KdTreeData& b) {
  return a.references == b.references && a.nodes.size() == b.nodes.size() &&
         std::memcmp(a.nodes.data(), b.nodes.data(), a.nodes.size() * sizeof(KdNode)) == 0;
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
    mesh::ObjectRay prepared;
    if (!is_valid(ray) || !prepared.prepare(ray, mesh.bounds())) continue;
    Hit expected;
    Hit found;
    for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
      const auto [p0, p1, p2] = mesh.corners(id);
      mesh::intersect_primitive<Precision::kRobust>(prepared, p0, p1, p2, id, expected);
    }
    tree->intersect<Precision::kRobust, false>(mesh, prepared, found);
    ASSERT_EQ(found.primitive_id, expected.primitive_id) << "ray " << i;
    ASSERT_EQ(found.t, expected.t) << "ray " << i;
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
    const Status valid = validate_kd_tree(built(mesh), mesh);
    EXPECT_TRUE(valid.ok()) << valid.error().message << " " << valid.error().where;
    const StructureStats stats = stats_of(mesh);
    EXPECT_LE(stats.reference_count, kMaxReferencesPerTriangle * mesh.triangle_count() + 64);
    EXPECT_LE(stats.max_depth, kMaxKdDepth);
    EXPECT_EQ(stats.node_count, 2 * stats.leaf_count - 1);
  }
}

TEST(KdTreeBuild, the_tree_does_not_depend_on_the_number_of_threads) {
  const TriangleMesh mesh = test::soup(20000, 8, 0.05F);
  const KdTreeData many = built(mesh);
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
  EXPECT_LE(stats_of(mesh).reference_count, mesh.triangle_count());
}

TEST(KdTreeBuild, triangles_that_shrink_geometrically_stay_within_the_stack) {
  TriangleMesh mesh;
  for (int k = 0; k < 5000; ++k) {
    const float size = std::ldexp(1.F, -(k % 120));
    const auto first = std::uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), {{size, 0, 0}, {0, size, 0}, {0, 0, size}});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  EXPECT_LE(stats_of(mesh).max_depth, kMaxKdDepth);
  EXPECT_TRUE(validate_kd_tree(built(mesh), mesh).ok());
  expect_hits_of_brute_force(mesh, 300);
}

TEST(KdTreeBuild, empty_space_between_far_meshes_is_cut_off) {
  TriangleMesh mesh = test::icosphere(3);
  const TriangleMesh other = test::translated(mesh, {100, 0, 0});
  const auto shift = std::uint32_t(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), other.positions.begin(), other.positions.end());
  for (const auto& [a, b, c] : other.triangles) mesh.triangles.push_back({a + shift, b + shift, c + shift});
  const StructureStats stats = stats_of(mesh);
  EXPECT_LT(stats.cost, 0.05 * double(mesh.triangle_count()));
  EXPECT_TRUE(validate_kd_tree(built(mesh), mesh).ok());
}

TEST(KdTreeTraversal, triangles_in_the_split_planes_are_hit) {
  TriangleMesh mesh;
  for (int i = 0; i < 400; ++i) {
    const Vec3f lower(float(i % 20), 0.F, float(i / 20));
    const TriangleMesh house = test::box(lower, lower + Vec3f(1.F, float(1 + i % 7), 1.F));
    const auto first = std::uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), house.positions.begin(), house.positions.end());
    for (const auto& [a, b, c] : house.triangles) mesh.triangles.push_back({a + first, b + first, c + first});
  }
  EXPECT_TRUE(validate_kd_tree(built(mesh), mesh).ok());
  expect_hits_of_brute_force(mesh, 1000);
}

TEST(KdTreeTraversal, flat_and_binned_scenes_equal_brute_force) {
  expect_hits_of_brute_force(test::quad_grid(60), 300);
  expect_hits_of_brute_force(test::soup(20 * int(kExactSplits), 3, 0.02F), 300);
}

class KdTreeValidate : public testing::Test {
 protected:
  const TriangleMesh mesh_ = test::icosphere(3);
  KdTreeData tree_ = built(mesh_);

  std::size_t find_node(bool leaf) const {
    for (std::size_t i = tree_.nodes.size() / 2; i < tree_.nodes.size(); ++i)
      if (tree_.nodes[i].is_leaf() == leaf && (!leaf || tree_.nodes[i].count() > 1)) return i;
    return 0;
  }
  bool valid() const { return validate_kd_tree(tree_, mesh_).ok(); }
};

TEST_F(KdTreeValidate, a_triangle_missing_from_a_leaf_is_caught) {
  ASSERT_TRUE(valid());
  KdNode& leaf = tree_.nodes[find_node(true)];
  tree_.references[leaf.first()] = (tree_.references[leaf.first()] + 640) % 1280;
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, a_plane_outside_its_cell_is_caught) {
  KdNode& node = tree_.nodes[find_node(false)];
  node = KdNode::inner(node.axis(), 5.F, node.second_child());
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, a_moved_plane_is_caught) {
  KdNode& root = tree_.nodes[0];
  root = KdNode::inner(root.axis(), root.plane() + 0.3F, root.second_child());
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, a_wrong_link_is_caught) {
  KdNode& node = tree_.nodes[find_node(false)];
  node = KdNode::inner(node.axis(), node.plane(), node.second_child() + 1);
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, a_reference_out_of_range_is_caught) {
  tree_.references.back() = 5000;
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, moved_vertices_are_caught) {
  const TriangleMesh moved = test::icosphere(3, 1.5F);
  EXPECT_FALSE(validate_kd_tree(tree_, moved).ok());
}

}  // namespace
}  // namespace gridcast::blas
