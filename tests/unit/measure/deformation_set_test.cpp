#include "core/measure/deformation_set.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <string>

#include <gtest/gtest.h>

#include "core/measure/meshes.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::measure {
namespace {

using Positions = std::vector<Vec3f>;

constexpr std::uint64_t kSeed = 7;

bool same_bits(const Positions& a, const Positions& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(Vec3f)) == 0;
}

Bounds3d box_of(const Positions& positions) {
  Bounds3d box;
  for (const Vec3f& p : positions) box.extend(Vec3d(p));
  return box;
}

Positions sorted(Positions positions) {
  std::ranges::sort(positions, {}, [](const Vec3f& p) { return std::array{p.x, p.y, p.z}; });
  return positions;
}

class DeformationSet : public testing::Test {
 protected:
  [[nodiscard]] Positions at(Deformation deformation, double phase) const {
    return deformed(deformation, rest_, phase, kSeed);
  }

  Positions rest_ = [] {
    Positions rest = organic_mesh(2000, kSeed).positions;
    for (Vec3f& p : rest) p += Vec3f(3.F, -5.F, 40.F);
    rest[5].x = -0.F;
    return rest;
  }();
};

TEST_F(DeformationSet, NamesAreDistinct) {
  std::set<std::string_view> names;
  for (const Deformation deformation : kAllDeformations) names.insert(to_string(deformation));
  EXPECT_EQ(names.size(), kAllDeformations.size());
}

TEST_F(DeformationSet, BeginsAtRestAndMovesFromThereAndSaysTheSameTwice) {
  for (const Deformation deformation : kAllDeformations) {
    SCOPED_TRACE(to_string(deformation));
    EXPECT_EQ(same_bits(at(deformation, 0.0), rest_), deformation != Deformation::kReturn);
    EXPECT_FALSE(same_bits(at(deformation, 0.25), rest_));
    EXPECT_TRUE(same_bits(at(deformation, 0.25), at(deformation, 0.25)));
  }
}

TEST_F(DeformationSet, AllVerticesStayAcceptable) {
  for (const Deformation deformation : kAllDeformations)
    for (const double phase : {0.01, 0.5, 0.99, 1.0})
      EXPECT_TRUE(mesh::validate_positions(at(deformation, phase))) << to_string(deformation) << ' ' << phase;
  // Neither a flat mesh nor a point nor nothing has a size to divide by.
  for (const Positions& rest :
       {Positions(4, Vec3f(1.F, 2.F, 3.F)), Positions{{0, 0, 0}, {1, 0, 0}}, Positions{}})
    for (const Deformation deformation : kAllDeformations)
      EXPECT_TRUE(mesh::validate_positions(deformed(deformation, rest, 0.7, kSeed)))
          << to_string(deformation);
}

TEST_F(DeformationSet, ReturnsFromAShuffleToTheSameBits) {
  EXPECT_TRUE(same_bits(sorted(at(Deformation::kReturn, 0.0)), sorted(rest_)));
  EXPECT_FALSE(same_bits(at(Deformation::kReturn, 0.5), rest_));
  for (const double phase : {0.51, 0.75, 1.0})
    EXPECT_TRUE(same_bits(at(Deformation::kReturn, phase), rest_)) << phase;
}

TEST_F(DeformationSet, ShufflesDealOutTheSameVerticesAnew) {
  const Positions one = at(Deformation::kShuffle, 0.5), other = at(Deformation::kShuffle, 0.6);
  EXPECT_TRUE(same_bits(sorted(one), sorted(rest_)));
  EXPECT_FALSE(same_bits(one, other));
}

TEST_F(DeformationSet, CollapsesEndInAPlaneALineAndNearAPoint) {
  const Vec3d size = box_of(rest_).extent();
  const Vec3d plane = box_of(at(Deformation::kCollapsePlane, 1.0)).extent();
  EXPECT_EQ(plane.y, 0.0);
  EXPECT_NEAR(plane.x, size.x, 1e-4);
  const Vec3d line = box_of(at(Deformation::kCollapseLine, 1.0)).extent();
  EXPECT_EQ(std::max(line.y, line.z), 0.0);
  EXPECT_NEAR(line.x, size.x, 1e-4);
  EXPECT_LT(max_abs(box_of(at(Deformation::kCollapsePoint, 1.0)).extent()), 1e-5);
}

TEST_F(DeformationSet, TwistTurnsTopAgainstBottomFourTimes) {
  const Vec3d centre = box_of(rest_).center();
  const Positions twisted = at(Deformation::kTwist, 1.0);
  const double size = max_abs(box_of(rest_).extent());
  for (std::size_t i = 0; i < rest_.size(); ++i) {
    const Vec3d from = Vec3d(rest_[i]) - centre, to = Vec3d(twisted[i]) - centre;
    EXPECT_NEAR(to.y, from.y, 1e-5);
    EXPECT_NEAR(std::hypot(to.x, to.z), std::hypot(from.x, from.z), 1e-4);
    const double turned = 8.0 * 3.14159265358979323846 * from.y / size;
    EXPECT_NEAR(to.x, from.x * std::cos(turned) - from.z * std::sin(turned), 1e-4);
  }
}

TEST_F(DeformationSet, AnExplosionLeavesNoTriangleInOnePiece) {
  const double size = max_abs(box_of(rest_).extent());
  EXPECT_LT(max_abs(box_of(at(Deformation::kExplode, 0.01)).extent()), 1.1 * size);
  EXPECT_GT(max_abs(box_of(at(Deformation::kExplode, 1.0)).extent()), 5e3 * size);
}

}  // namespace
}  // namespace gridcast::measure
