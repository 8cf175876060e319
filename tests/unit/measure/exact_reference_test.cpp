// The reference against answers found by hand, on whole numbers.
#include "tests/support/exact_reference.h"

#include <array>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "core/measure/exact/reference.h"
#include "tests/support/shapes.h"

namespace gridcast::measure::exact {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct OwnMesh {
  std::vector<Vec3f> positions;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  [[nodiscard]] Mesh view() const { return {positions, triangles}; }
};

/// (0,0,0) (4,0,0) (0,4,0), and the same turned over and repeated as asked.
OwnMesh corner_triangle(std::size_t copies = 1) {
  OwnMesh mesh{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}, {}};
  for (std::size_t i = 0; i < copies; ++i)
    mesh.triangles.push_back(i % 2 == 0 ? std::array{0U, 1U, 2U} : std::array{2U, 1U, 0U});
  return mesh;
}

Reference reference_of_one(const OwnMesh& mesh, const Affine& affine = {}) {
  return Reference::build({mesh.view()}, {{7, 0, affine}}).value();
}

Ray down(double x, double y) {
  return {{x, y, 3.0}, {0.0, 0.0, -1.0}};
}

TEST(ExactReference, HitsInsideEdgesAndVertices) {
  const OwnMesh mesh = corner_triangle();
  const Reference reference = reference_of_one(mesh);
  struct Case {
    double x, y, u, v;
  };
  for (const Case& c : {Case{1, 1, 0.25, 0.25}, Case{0, 0, 0, 0}, Case{4, 0, 1, 0}, Case{0, 4, 0, 1},
                        Case{2, 0, 0.5, 0}, Case{0, 1, 0, 0.25}, Case{3, 1, 0.75, 0.25}}) {
    const auto hit = reference.closest(down(c.x, c.y));
    ASSERT_TRUE(hit) << c.x << ", " << c.y;
    EXPECT_EQ(compare(hit->at.t, 3.0), 0);
    EXPECT_EQ(hit->at.u, c.u);
    EXPECT_EQ(hit->at.v, c.v);
    EXPECT_EQ(hit->primitive, (PrimitiveRef{7, 0}));
    EXPECT_TRUE(reference.any(down(c.x, c.y)));
    EXPECT_EQ(reference.all(down(c.x, c.y)).size(), 1U);
  }
}

TEST(ExactReference, MissesByTheLeastThatDoublesCanSay) {
  const OwnMesh mesh = corner_triangle();
  const Reference reference = reference_of_one(mesh);
  const double below = -std::numeric_limits<double>::denorm_min();
  for (const Ray& ray : {down(below, 1), down(1, below), down(2.0, std::nextafter(2.0, 3.0)), down(5, 0),
                         down(below, below)}) {
    EXPECT_FALSE(reference.closest(ray));
    EXPECT_FALSE(reference.any(ray));
    EXPECT_TRUE(reference.all(ray).empty());
  }
}

TEST(ExactReference, TheRangeIsClosedAtBothEnds) {
  const OwnMesh mesh = corner_triangle();
  const Reference reference = reference_of_one(mesh);
  const auto hits = [&](double tnear, double tfar) {
    Ray ray = down(1, 1);
    ray.tnear = tnear, ray.tfar = tfar;
    const bool any = reference.any(ray);
    EXPECT_EQ(any, reference.closest(ray).has_value());
    return any;
  };
  EXPECT_TRUE(hits(3, 3));
  EXPECT_TRUE(hits(3, kInfinity));
  EXPECT_TRUE(hits(-kInfinity, 3));
  EXPECT_FALSE(hits(std::nextafter(3.0, 4.0), kInfinity));
  EXPECT_FALSE(hits(0, std::nextafter(3.0, 2.0)));
  EXPECT_FALSE(hits(4, 3));
  EXPECT_FALSE(hits(kInfinity, kInfinity));
  EXPECT_FALSE(hits(-kInfinity, -kInfinity));
  // Behind the origin, with a negative tnear.
  const Ray behind{{1, 1, 3}, {0, 0, 1}, -5.0};
  ASSERT_TRUE(reference.closest(behind));
  EXPECT_EQ(compare(reference.closest(behind)->at.t, -3.0), 0);
}

TEST(ExactReference, RaysInThePlaneHitNothing) {
  const OwnMesh mesh = corner_triangle();
  const Reference reference = reference_of_one(mesh);
  EXPECT_FALSE(reference.any({{-1, 1, 0}, {1, 0, 0}}));
  EXPECT_FALSE(reference.any({{-1, 0, 0}, {1, 0, 0}}));  // along an edge
  EXPECT_FALSE(reference.any({{1, 1, 0}, {1, 2, 0}}));   // from inside of it
  EXPECT_FALSE(reference.any({{0, 0, 0}, {0, 0, 0}}));   // no direction at all
  EXPECT_FALSE(reference.any({{1, 1, kInfinity}, {0, 0, -1}}));
  EXPECT_FALSE(reference.any({{1, 1, 1}, {0, 0, std::numeric_limits<double>::quiet_NaN()}}));
  // The least slope that a double has is a slope.
  EXPECT_TRUE(reference.any({{1, 1, 0}, {1, 0, -std::numeric_limits<double>::denorm_min()}}));
}

TEST(ExactReference, TrianglesWithoutAreaAreNotThere) {
  const OwnMesh mesh{{{0, 0, 0}, {1, 1, 0}, {2, 2, 0}}, {{0, 1, 2}, {0, 0, 2}, {1, 1, 1}}};
  const Reference reference = reference_of_one(mesh);
  EXPECT_FALSE(reference.any(down(1, 1)));
  EXPECT_FALSE(reference.any(down(0, 0)));
  EXPECT_FALSE(reference.any({{1, 0, 0}, {0, 1, 0}}));
}

TEST(ExactReference, TiesGoToTheSmallerIds) {
  const OwnMesh mesh = corner_triangle(1000);
  const Reference reference =
      Reference::build({mesh.view()}, {{9, 0, {}}, {3, 0, {}}, {5, 0, {Mat3d(1.0), {0, 0, 1}}}}).value();
  // Instance 5 is one nearer; 3 and 9 tie.
  EXPECT_EQ(reference.closest(down(1, 1))->primitive, (PrimitiveRef{5, 0}));
  EXPECT_EQ(reference.closest(down(1, 1), {5, 0})->primitive, (PrimitiveRef{5, 1}));
  Ray behind = down(1, 1);
  behind.tnear = 2.5;
  EXPECT_EQ(reference.closest(behind)->primitive, (PrimitiveRef{3, 0}));
  const auto all = reference.all(down(1, 1));
  ASSERT_EQ(all.size(), 3000U);
  for (std::size_t i = 0; i < all.size(); ++i)
    EXPECT_EQ(all[i].primitive, (PrimitiveRef{i < 1000 ? 5U : i < 2000 ? 3U : 9U, std::uint32_t(i % 1000)}));
}

TEST(ExactReference, OneTriangleMayBeAskedFor) {
  const OwnMesh mesh = corner_triangle(2);
  const Reference reference = reference_of_one(mesh);
  const auto hit = reference.of_primitive(down(1, 1), {7, 1});
  ASSERT_TRUE(hit);
  EXPECT_EQ(compare(hit->at.t, 3.0), 0);
  EXPECT_FALSE(reference.of_primitive(down(5, 5), {7, 1}));
  EXPECT_FALSE(reference.of_primitive(down(1, 1), {7, 2}));
  EXPECT_FALSE(reference.of_primitive(down(1, 1), {6, 0}));
  EXPECT_FALSE(reference.of_primitive(down(1, 1), {}));
}

TEST(ExactReference, MirrorsAndShearsAreTakenExactly) {
  const OwnMesh mesh = corner_triangle();
  // (x, y, z) -> (-x + y + 10, y + 2, 3 z + 5 x + 1): at object (1, 1): t = 30 - 6 from z = 30.
  const Affine affine{Mat3d(Vec3d(-1, 0, 5), Vec3d(1, 1, 0), Vec3d(0, 0, 3)), {10, 2, 1}};
  const Reference reference = reference_of_one(mesh, affine);
  const auto hit = reference.closest({{10, 3, 30}, {0, 0, -1}});
  ASSERT_TRUE(hit);
  EXPECT_EQ(compare(hit->at.t, 24.0), 0);
  EXPECT_EQ(hit->at.u, 0.25);
  EXPECT_EQ(hit->at.v, 0.25);
  // The sheared vertex (0, 4) lies at (14, 6, 1); the next double beyond it is outside.
  EXPECT_TRUE(reference.any({{14, 6, 30}, {0, 0, -1}}));
  EXPECT_FALSE(reference.any({{std::nextafter(14.0, 15.0), 6, 30}, {0, 0, -1}}));
}

TEST(ExactReference, AThirdOfAUnitIsNotADouble) {
  const OwnMesh mesh{{{0, 0, 0}, {3, 0, 1}, {0, 3, 0}}, {{0, 1, 2}}};
  const Reference reference = reference_of_one(mesh);
  // The plane is z = x / 3.
  const auto hit = reference.closest({{1, 1, 1}, {0, 0, -1}});
  ASSERT_TRUE(hit);
  EXPECT_EQ(compare(hit->at.t, Ratio(2.0, 3.0)), 0);
  EXPECT_EQ(hit->at.t.to_double(), 2.0 / 3.0);
  EXPECT_NE(compare(hit->at.t, 2.0 / 3.0), 0);
}

TEST(ExactReference, ScalesFromDenormalsToTheEndOfFloat) {
  for (const float scale : {std::numeric_limits<float>::denorm_min(), 1e-40F, 1e-30F, 1e30F, 5e37F}) {
    const OwnMesh mesh{{{0, 0, 0}, {4 * scale, 0, 0}, {0, 4 * scale, 0}}, {{0, 1, 2}}};
    const Reference reference = reference_of_one(mesh);
    const double s = double(scale);
    const auto hit = reference.closest({{s, s, 3 * s}, {0, 0, -s}});
    ASSERT_TRUE(hit) << scale;
    EXPECT_EQ(compare(hit->at.t, 3.0), 0);
    EXPECT_EQ(hit->at.u, 0.25);
    EXPECT_TRUE(reference.any({{4 * s, 0, 3 * s}, {0, 0, -s}}));
    EXPECT_FALSE(reference.any({{std::nextafter(4 * s, kInfinity), 0, 3 * s}, {0, 0, -s}}));
  }
}

TEST(ExactReference, RefusesWhatIsNotFiniteOrOutOfRange) {
  OwnMesh mesh = corner_triangle();
  const auto code = [&](const Instance& instance) {
    const auto made = Reference::build({mesh.view()}, {instance});
    return made ? std::string() : made.error().where;
  };
  EXPECT_EQ(code({0, 0, {}}), "");
  EXPECT_EQ(code({4, 1, {}}), "/instances/4");
  EXPECT_EQ(code({4, 0, {Mat3d(1.0), {0, kInfinity, 0}}}), "/instances/4");
  EXPECT_EQ(code({4, 0, {Mat3d(1e308), {0, 0, 0}}}), "/instances/4");
  mesh.triangles.push_back({0, 1, 3});
  EXPECT_EQ(code({0, 0, {}}), "/meshes/0/triangles/1");
  mesh.positions[2].x = std::numeric_limits<float>::infinity();
  EXPECT_EQ(code({0, 0, {}}), "/meshes/0/positions/2");
}

TEST(ExactReference, BuildingStopsWhenTold) {
  std::stop_source stop;
  const OwnMesh mesh = corner_triangle(1000);
  EXPECT_TRUE(Reference::build({mesh.view()}, {{0, 0, {}}}, stop.get_token()));
  stop.request_stop();
  const auto stopped = Reference::build({mesh.view()}, {{0, 0, {}}}, stop.get_token());
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
}

TEST(ExactReference, NothingIsHitInAnEmptyScene) {
  EXPECT_FALSE(Reference::build({}, {}).value().any(down(0, 0)));
  const OwnMesh nothing;
  EXPECT_FALSE(reference_of_one(nothing).any(down(0, 0)));
}

TEST(ExactReference, OfASceneLeavesOutInactiveInstances) {
  const test::ExactScene flat(test::share(test::single_triangle()),
                              {Mat3d(Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0)), {}});
  EXPECT_FALSE(flat->any(down(0.25, 0.25)));
  EXPECT_TRUE(test::ExactScene(test::share(test::single_triangle()))->any(down(0.25, 0.25)));
}

}  // namespace
}  // namespace gridcast::measure::exact
