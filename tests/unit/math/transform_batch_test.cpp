#include "core/math/transform_batch.h"

#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "core/math/instruction_set.h"
#include "tests/support/random.h"

namespace gridcast {
namespace {

/// Good, mirrored, nearly singular, singular, huge, tiny, not finite.
Affine awkward_affine(test::Random& random) {
  Affine affine{{random.direction(), random.direction(), random.direction()}, random.in_box(100.0)};
  affine.linear *= std::exp2(random.uniform(-3.0, 3.0));
  const std::uint32_t kind = random.below(12);
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
  return affine;
}

bool same_bits(const InstanceTransform& a, const InstanceTransform& b) {
  const auto same = [](const auto& x, const auto& y) { return std::memcmp(&x, &y, sizeof x) == 0; };
  const double numbers_a[] = {a.condition(), a.round_trip_error()};
  const double numbers_b[] = {b.condition(), b.round_trip_error()};
  return same(a.world_from_object(), b.world_from_object()) &&
         same(a.object_from_world_linear(), b.object_from_world_linear()) && same(numbers_a, numbers_b);
}

TEST(TransformBatch, is_the_single_transform_bit_for_bit_with_every_instruction_set) {
  const std::uint64_t seed = test::seed_or(71);
  for (const std::string_view set : instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(limit_instruction_set(set).ok());
    test::Random random(seed);
    TransformBatch batch;
    int active = 0, inactive = 0;
    for (int round = 0; round < 1000; ++round) {
      const auto count = 1 + random.below(TransformBatch::kSize);  // the other lanes hold what was there
      Affine affines[TransformBatch::kSize];
      for (std::size_t lane = 0; lane < count; ++lane)
        batch.set(lane, affines[lane] = awkward_affine(random));
      batch.invert();
      InstanceTransform made_at_once[TransformBatch::kSize];
      InstanceTransform* wanted[TransformBatch::kSize];
      for (std::size_t lane = 0; lane < count; ++lane) wanted[lane] = &made_at_once[lane];
      batch.get({wanted, count});
      for (std::size_t lane = 0; lane < count; ++lane) {
        const InstanceTransform alone(affines[lane]);
        InstanceTransform made;
        batch.get(lane, made);
        ASSERT_EQ(made.active(), alone.active());
        ASSERT_EQ((batch.active() >> lane) & 1U, std::uint32_t(alone.active()));
        ASSERT_TRUE(!alone.active() || same_bits(made, alone));
        ASSERT_EQ(made_at_once[lane].active(), alone.active());
        ASSERT_TRUE(!alone.active() || same_bits(made_at_once[lane], alone));
        (alone.active() ? active : inactive)++;
      }
    }
    EXPECT_GT(active, 1000);
    EXPECT_GT(inactive, 500);
  }
  EXPECT_TRUE(limit_instruction_set(kNativeInstructionSet).ok());
}

}  // namespace
}  // namespace gridcast
