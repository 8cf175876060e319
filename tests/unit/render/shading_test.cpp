#include <numbers>
#include <set>

#include <gtest/gtest.h>

#include "core/render/brdf.h"
#include "core/render/sampling.h"
#include "core/render/sky.h"
#include "tests/support/random.h"

namespace gridcast::render {
namespace {

Vec3d cosine_weighted(const Vec3d& normal, test::Random& random) {
  return glm::normalize(normal + 0.999999 * random.direction());
}

TEST(Sky, ambient_light_is_the_mean_of_the_sky_over_the_hemisphere) {
  test::Random random(test::seed_or(41));
  const Sky sky{2.F};
  for (const Vec3d& normal : {Vec3d(0, 1, 0), Vec3d(1, 0, 0), Vec3d(0, -1, 0)}) {
    Vec3d sum(0.0);
    const int count = 200000;
    for (int i = 0; i < count; ++i) sum += Vec3d(sky.radiance(cosine_weighted(normal, random)));
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(sky.ambient(normal)[c], sum[c] / count, 0.005) << normal.y;
  }
}

TEST(Sky, glossy_goes_from_the_mirror_image_to_the_ambient_light) {
  const Sky sky;
  const Vec3d up(0, 1, 0);
  EXPECT_EQ(sky.glossy(up, 0.F), sky.radiance(up));
  EXPECT_EQ(sky.glossy(up, 1.F), sky.ambient(up));
}

scene::Material material(float metallic, float roughness) {
  scene::Material m;
  m.base_color = {0.8F, 0.5F, 0.2F, 1.F};
  m.metallic = metallic;
  m.roughness = roughness;
  return m;
}

TEST(Brdf, is_symmetric_in_view_and_light) {
  test::Random random(test::seed_or(42));
  const Vec3d normal(0, 0, 1);
  for (int i = 0; i < 1000; ++i) {
    const Brdf brdf = make_brdf(material(float(random.uniform()), float(random.uniform(0.1, 1.0))));
    const Vec3d a = cosine_weighted(normal, random), b = cosine_weighted(normal, random);
    const Vec3f ab = brdf.evaluate(normal, a, b), ba = brdf.evaluate(normal, b, a);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(ab[c], ba[c], 1e-4F * (1.F + ab[c]));
  }
}

TEST(Brdf, reflects_no_more_light_than_it_gets) {
  test::Random random(test::seed_or(43));
  const Vec3d normal(0, 0, 1);
  for (const float metallic : {0.F, 1.F}) {
    for (const float roughness : {0.3F, 0.6F, 1.F}) {
      scene::Material white = material(metallic, roughness);
      white.base_color = {1.F, 1.F, 1.F, 1.F};
      const Brdf brdf = make_brdf(white);
      const Vec3d view = glm::normalize(Vec3d(0.6, 0.0, 0.8));
      double sum = 0.0;
      const int count = 100000;
      for (int i = 0; i < count; ++i)
        sum += std::numbers::pi * double(brdf.evaluate(normal, view, cosine_weighted(normal, random)).x);
      EXPECT_LT(sum / count, 1.03) << metallic << ' ' << roughness;
      EXPECT_GT(sum / count, 0.3) << metallic << ' ' << roughness;
    }
  }
}

TEST(Brdf, metals_have_no_matt_part_and_a_coloured_mirror) {
  const Brdf metal = make_brdf(material(1.F, 0.5F)), plastic = make_brdf(material(0.F, 0.5F));
  EXPECT_EQ(metal.diffuse, Vec3f(0.F));
  EXPECT_EQ(metal.specular, Vec3f(0.8F, 0.5F, 0.2F));
  EXPECT_EQ(plastic.diffuse, Vec3f(0.8F, 0.5F, 0.2F));
  EXPECT_NEAR(plastic.specular.x, 0.04F, 1e-6F);
}

TEST(Brdf, values_out_of_range_are_clamped) {
  scene::Material wild = material(-3.F, 9.F);
  wild.base_color = {5.F, -1.F, std::numeric_limits<float>::quiet_NaN(), 1.F};
  const Brdf brdf = make_brdf(wild);
  EXPECT_EQ(brdf.diffuse, Vec3f(1.F, 0.F, 0.F));
  EXPECT_EQ(brdf.roughness, 1.F);
}

TEST(PixelSample, one_sample_lies_in_the_centre) {
  EXPECT_EQ(pixel_sample(3, 4, 0, 1), glm::dvec2(0.5, 0.5));
}

TEST(PixelSample, many_fill_rows_and_columns_evenly_and_differ_between_pixels) {
  const std::uint32_t count = 16;
  for (std::uint32_t pixel = 0; pixel < 50; ++pixel) {
    std::set<int> columns;
    int upper = 0;
    for (std::uint32_t i = 0; i < count; ++i) {
      const glm::dvec2 s = pixel_sample(pixel, 7, i, count);
      ASSERT_TRUE(s.x >= 0.0 && s.x < 1.0 && s.y >= 0.0 && s.y < 1.0);
      columns.insert(int(s.x * count));
      upper += s.y < 0.5 ? 1 : 0;
    }
    EXPECT_EQ(columns.size(), count);
    EXPECT_EQ(upper, 8);
  }
  EXPECT_NE(pixel_sample(1, 1, 0, 4), pixel_sample(2, 1, 0, 4));
  EXPECT_NE(pixel_sample(1, 2, 0, 4), pixel_sample(2, 1, 0, 4));
}

}  // namespace
}  // namespace gridcast::render
