// Trees where their splits go wrong: triangles in planes, cells without volume, nothing to part.

#include <gtest/gtest.h>

#include "core/blas/bvh_node.h"
#include "core/blas/kd_tree_clip.h"
#include "core/blas/kd_tree_node.h"
#include "core/blas/kd_treelet.h"
#include "tests/stability/subject.h"
#include "tests/stability/truth.h"
#include "tests/support/rational.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::stability {
namespace {

using blas::StructureKind;

/// Every structure over the mesh keeps its invariants, and no path is longer than its stack.
void expect_sound(const MeshSource& source) {
  for (const StructureKind kind :
       {StructureKind::kBvh, StructureKind::kWideBvh, StructureKind::kCompactBvh, StructureKind::kKdTree}) {
    const auto tree = blas::Blas::build(source.mesh, {kind});
    ASSERT_TRUE(tree.ok()) << source.spec << ": " << tree.error().message;
    // The kd-tree's validator searches a leaf for each of its triangles: too slow for leaves of 100,000.
    const bool kd = kind == StructureKind::kKdTree;
    const Status valid = kd && source.mesh->triangle_count() > 10000 ? ok_status() : tree->validate();
    EXPECT_TRUE(valid.ok()) << source.spec << ", " << blas::to_string(kind) << ": " << valid.error().where
                            << ' ' << valid.error().message;
    const blas::StructureStats stats = tree->stats();
    EXPECT_LE(stats.max_depth, kd ? blas::kMaxKdDepth : blas::kMaxBvhDepth) << source.spec;
    EXPECT_LE(stats.reference_count, blas::kMaxReferencesPerTriangle * stats.triangle_count) << source.spec;
    EXPECT_LE(stats.node_count, 2 * blas::kMaxReferencesPerTriangle * stats.triangle_count + 1)
        << source.spec;
    EXPECT_TRUE(std::isfinite(stats.cost)) << source.spec;
  }
}

/// Rays of every kind at a mesh, judged by every triangle and, in exact mode, by the exact reference.
void shoot_around(Row& row, const std::string& spec, std::size_t rays) {
  const MeshSource source = generated(spec);
  expect_sound(source);
  Subject subject(placed(source));
  const WorldTruth truth(subject.spec());
  blas::RayMaker maker(*source.mesh, row.seed());
  row.blocks(rays, [&](test::Random&, std::size_t count) {
    std::vector<Shot> shots;
    for (std::size_t i = 0; i < count; ++i) {
      const Ray ray = maker.any().ray;
      shots.push_back(truth.shot(subject.scene(), ray));
    }
    subject.shoot(row, shots);
  });
}

TEST(Stability, RC31_TrianglesInSplitPlanes) {
  Row row(31, 6000);
  const char* const specs[] = {"coplanar_stack 1 24",
                               "coplanar_stack 12 6",
                               "coplanar_stack 12 6 | swap",
                               "box_city 8 31",
                               "box_city 4 3 | repeat 5 | shuffle 31",
                               "quad_grid 4 4 | repeat 60"};
  for (const char* spec : specs) shoot_around(row, spec, row.rays(std::size(specs)));
}

/// The part of a triangle in a closed box, corner by corner in rationals (I. Sutherland, 1974).
std::vector<test::Rational3> exact_clip(const std::array<Vec3f, 3>& corners, const Bounds3f& cell) {
  std::vector<test::Rational3> polygon;
  for (const Vec3f& corner : corners) polygon.push_back(test::rational(Vec3d(corner)));
  for (std::size_t side = 0; side < 6 && !polygon.empty(); ++side) {
    const std::size_t axis = side / 2;
    const test::Rational plane(side % 2 == 0 ? cell.lower[int(axis)] : cell.upper[int(axis)]);
    const auto beyond = [&](const test::Rational3& p) {
      return test::Rational(side % 2 == 0 ? plane - p[axis] : p[axis] - plane);
    };
    std::vector<test::Rational3> kept;
    for (std::size_t i = 0; i < polygon.size(); ++i) {
      const test::Rational3 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
      const test::Rational from = beyond(a), to = beyond(b);
      if (from <= 0) kept.push_back(a);
      if (sgn(from) * sgn(to) >= 0) continue;
      const test::Rational share = from / (from - to);
      test::Rational3 cut;
      for (std::size_t k = 0; k < 3; ++k) cut[k] = a[k] + share * (b[k] - a[k]);
      kept.push_back(cut);
    }
    polygon = std::move(kept);
  }
  return polygon;
}

/// Whether the engine's clipped box holds every corner of the exact polygon.
bool holds_exact_clip(const std::array<Vec3f, 3>& corners, const Bounds3f& cell) {
  const auto polygon = exact_clip(corners, cell);
  const auto box = blas::clip_triangle(corners, cell);
  if (!box) return polygon.empty();
  for (const test::Rational3& p : polygon)
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (p[axis] < test::Rational(box->lower[int(axis)]) || p[axis] > test::Rational(box->upper[int(axis)]))
        return false;
  return true;
}

TEST(Stability, RC32_FlatCellsAndClippedSlivers) {
  Row row(32, 2400);
  const char* const specs[] = {"flat 3000 32", "quad_grid 16 16 | scale 1 1e-30 1", "slivers 800 32 1e6",
                               "slivers 400 32 1e4 | scale 1 1 0"};
  for (const char* spec : specs) shoot_around(row, spec, row.rays(std::size(specs)));
  // Cells that cut a sliver again and again, at its own corners and in its own plane too.
  std::size_t cut = 0;
  for (const char* spec : {"slivers 300 5 1e6", "slivers 300 6 1e2", "box_city 3 32", "soup 300 32 0.5"}) {
    const MeshSource source = generated(spec);
    row.blocks(row.rays(4), [&](test::Random& random, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i) {
        const auto corners = source.mesh->corners(random.below(std::uint32_t(source.mesh->triangle_count())));
        Bounds3f cell = source.mesh->bounds();
        for (int halving = 0; halving < 10; ++halving) {
          const int axis = int(random.below(3));
          const float where = random.below(3) == 0
                                  ? corners[random.below(3)][axis]
                                  : float(random.uniform(cell.lower[axis], cell.upper[axis]));
          if (where < cell.lower[axis] || where > cell.upper[axis]) continue;
          (random.below(2) == 0 ? cell.lower : cell.upper)[axis] = where;
          if (exact_clip(corners, cell).empty()) break;
          ++cut;
          if (!holds_exact_clip(corners, cell)) row.fail(std::string("a clipped box loses a part: ") + spec);
        }
      }
    });
  }
  EXPECT_GT(cut, row.rays());
}

// Nothing to part by: one centre for all, a series of halves, slivers in order, copies.
TEST(Stability, RC34_DepthAndStacks) {
  Row row(34, 200);
  const std::pair<const char*, std::size_t> specs[] = {
      {"concentric 1000", row.rays(8)},
      {"geometric 100000", row.rays(60)},  // most lie within rounding of one point
      {"slivers 4000 34 1e3", row.rays(4)},
      {"slivers 3000 34 1e5 | shrink 7", row.rays(4)},
      {"triangle | repeat 100000", row.rays(150)},  // all of them are tested for each ray
  };
  for (const auto& [spec, rays] : specs) shoot_around(row, spec, rays);
}

}  // namespace
}  // namespace gridcast::stability
