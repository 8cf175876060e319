// Several instances placed at once: the same as one by one, with every instruction set.

#include "core/scene/place_batch.h"

#include <cstring>
#include <limits>

#include "core/math/instruction_set.h"
#include "core/scene/hit_box.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::scene {
namespace {

MeshHull hull_of(const mesh::TriangleMesh& mesh) {
  return MeshHull(mesh, mesh.bounds());
}

/// Good, mirrored, nearly singular, singular, huge, tiny, flat, not finite.
Affine awkward_affine(test::Random& random) {
  Affine affine{{random.direction(), random.direction(), random.direction()}, random.in_box(100.0)};
  affine.linear *= std::exp2(random.uniform(-3.0, 3.0));
  const std::uint32_t kind = random.below(14);
  const auto c = int(random.below(3)), r = int(random.below(3));
  constexpr double kBad[] = {std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity(),
                             -std::numeric_limits<double>::infinity(),
                             1e308,
                             1e-308,
                             0x1p101};
  const double bad = kBad[random.below(6)];
  if (kind == 0) affine.linear[c] = affine.linear[(c + 1) % 3] + 1e-13 * affine.linear[c];
  if (kind == 1) affine.linear[c] = affine.linear[(c + 1) % 3];
  if (kind == 2) affine.linear *= std::exp2(random.uniform(-103.0, 103.0));
  if (kind == 3) affine.linear[c] *= std::exp2(random.uniform(-50.0, 50.0));
  if (kind == 4) affine.linear[c][r] = bad;
  if (kind == 5) affine.translation[r] = bad;
  if (kind == 6) affine.linear = Mat3d(random.below(2) == 0 ? 0.0 : -1.0);
  if (kind == 7) affine.linear[c] = Vec3d(0.0);
  // Ties of components, where the order of the axes is a matter of choice.
  if (kind == 8) affine.linear = Mat3d(glm::dmat3(random.below(2) == 0 ? 2.0 : -1.0));
  if (kind == 9) affine.linear[1][0] = affine.linear[0][0];
  if (kind == 10) affine.linear[c] *= std::exp2(random.uniform(-700.0, 0.0));
  return affine;
}

template <class T>
bool same_bits(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

/// What is around what is written has to stay.
struct Place {
  double before = 1.5;
  InstanceTransform transform;
  double between = 2.5;
  tlas::InstanceBox box;
  double after = 3.5;
};

TEST(PlaceBatch, is_the_single_transform_and_box_bit_for_bit_with_every_instruction_set) {
  const std::uint64_t seed = test::seed_or(71);
  const MeshHull hulls[] = {hull_of(test::jittered_icosphere(3, 5)), hull_of(test::soup(200, 3)),
                            hull_of(test::translated(test::torus(12, 8), Vec3f(1e4F))), hull_of({})};
  for (const std::string_view set : instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(limit_instruction_set(set).ok());
    test::Random random(seed);
    PlaceBatch batch;
    int active = 0, inactive = 0, empty = 0;
    for (int round = 0; round < 2000; ++round) {
      const auto count = 1 + random.below(PlaceBatch::kSize);
      const std::uint32_t shared = random.below(8);  // one hull for all lanes, or any
      Affine affines[PlaceBatch::kSize];
      const MeshHull* hull_of_lane[PlaceBatch::kSize];
      Place places[PlaceBatch::kSize];
      for (std::size_t lane = 0; lane < count; ++lane) {
        affines[lane] = awkward_affine(random);
        hull_of_lane[lane] = &hulls[shared < 4 ? shared : random.below(4)];
        batch.add(affines[lane], *hull_of_lane[lane], places[lane].transform, places[lane].box);
      }
      const std::uint32_t found = batch.place();
      batch.clear();
      ASSERT_EQ(found >> count, 0U);
      for (std::size_t lane = 0; lane < count; ++lane) {
        const InstanceTransform alone(affines[lane]);
        const Place& made = places[lane];
        ASSERT_EQ((found >> lane) & 1U, std::uint32_t(alone.active()));
        ASSERT_EQ(made.transform.active(), alone.active());
        ASSERT_TRUE(made.before == 1.5 && made.between == 2.5 && made.after == 3.5);
        (alone.active() ? active : inactive)++;
        if (!alone.active()) continue;
        ASSERT_TRUE(same_bits(made.transform, alone));
        ASSERT_EQ(made.box, hit_box(alone, *hull_of_lane[lane]));
        empty += int(made.box.bounds.empty());
      }
    }
    EXPECT_GT(active, 2000);
    EXPECT_GT(inactive, 1000);
    EXPECT_GT(empty, 100);
  }
  EXPECT_TRUE(limit_instruction_set(kNativeInstructionSet).ok());
}

}  // namespace
}  // namespace gridcast::scene
