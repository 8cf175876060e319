#include <numbers>

#include <gtest/gtest.h>

#include "core/mesh/topology.h"
#include "core/render/lighting.h"
#include "core/render/sky.h"
#include "tests/unit/render/render_scene.h"

namespace gridcast::render {
namespace {

void expect_color(const Vec3f& a, const Vec3f& b, float bound = 1e-5F) {
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(a[c], b[c], bound);
}

mesh::TriangleMesh wall(float half) {
  mesh::TriangleMesh mesh = test::quad_grid(1, 2.F * half);
  for (Vec3f& p : mesh.positions) p -= Vec3f(half, half, 0.F);
  return mesh;
}

TEST(Whitted, the_background_is_the_sky_with_no_coverage) {
  const auto scene = SceneMaker().add(wall(1), matt(1, 1, 1)).build();
  for (const Vec3d& target : {Vec3d(0, 9, 5), Vec3d(3, -2, 8), Vec3d(5, 0.2, 9)}) {
    const Film film = rendered(*scene, one_ray({0, 0, 5}, target));
    expect_color(color_at(film), Sky{}.radiance(glm::normalize(target - Vec3d(0, 0, 5))));
    EXPECT_EQ(alpha_at(film, 0), 0.F);
  }
}

TEST(Whitted, unlit_colours_are_shown_as_they_are_under_any_light) {
  const Vec3f color(0.2F, 0.5F, 0.9F);
  for (const double lux : {0.0, 1e-3, 1e5}) {
    const auto scene = SceneMaker()
                           .add(wall(1), unlit(color.x, color.y, color.z))
                           .light(directional({0, 0, -1}, lux))
                           .build();
    const Film film = rendered(*scene, one_ray({0, 0, 5}, {0.1, 0.2, 0}));
    expect_color(film.exposure * color_at(film), color);
  }
}

TEST(Whitted, emission_is_added) {
  scene::Material black = matt(0, 0, 0), lamp = black;
  lamp.emissive = {3.F, 2.F, 1.F};
  const RenderSettings settings = one_ray({0, 0, 5}, {0.1, 0.2, 0});
  const Vec3f off = color_at(rendered(*SceneMaker().add(wall(1), black).build(), settings));
  const Vec3f on = color_at(rendered(*SceneMaker().add(wall(1), lamp).build(), settings));
  expect_color(on - off, {3.F, 2.F, 1.F});
}

TEST(Whitted, a_mirror_shows_the_object_behind_the_camera_only_with_a_bounce) {
  const auto scene =
      SceneMaker().add(wall(1), mirror()).add(wall(1), unlit(1.F, 0.F, 0.F), moved({1.0, 0.0, 10.0})).build();
  // From (-0.25, 0, 5) to the mirror's middle: the reflection crosses z = 10 at x = 0.5.
  RenderSettings settings = one_ray({-0.25, 0, 5}, {0, 0, 0});
  expect_color(color_at(rendered(*scene, settings)), {1.F, 0.F, 0.F}, 1e-3F);
  settings.max_depth = 0;
  EXPECT_GT(color_at(rendered(*scene, settings)).y, 0.02F);
}

TEST(Whitted, a_shadowed_point_is_darker_than_its_lit_neighbour) {
  for (const bool has_light : {false, true}) {
    SceneMaker maker;
    maker.add(wall(5), matt(0.8F, 0.8F, 0.8F));
    // A small plate before the wall; the default sun comes over the right shoulder of the camera, so its
    // shadow falls to the lower left.
    maker.add(wall(0.3F), matt(0.8F, 0.8F, 0.8F), moved({0.75, 0.85, 1.0}));
    if (has_light) maker.light(directional({-0.75, -0.85, -1.0}, 1000.0));
    const RenderSettings settings = from_front(4.0, 64);
    const auto scene = maker.build();
    const Film film = rendered(*scene, settings);
    float darkest = 1e30F, lightest = 0.F;
    for (int i = 0; i < 64 * 64; ++i) {
      const float green = film.exposure * color_at(film, i % 64, i / 64).y;
      darkest = std::min(darkest, green);
      lightest = std::max(lightest, green);
    }
    EXPECT_LT(darkest, 0.65F * lightest) << has_light;
    EXPECT_GT(darkest, 0.02F) << has_light;
    if (has_light) {
      // Exactly where the light carries the plate's middle.
      EXPECT_LT(color_at(film, 32, 31).y, 0.5F * color_at(film, 16, 16).y);
    }
  }
}

// A glowing stripe behind a slab of glass of thickness 1, seen at 45 degrees: the ray leaves parallel to how
// it came, moved sideways by what Snell's law says.
TEST(Whitted, a_slab_of_glass_shifts_a_ray_and_does_not_bend_it) {
  const double ior = 1.5, sine = std::numbers::sqrt2 / 2.0;
  const double inside = sine / ior;
  const double shift_in_slab = inside / std::sqrt(1.0 - inside * inside);  // along x while z changes by 1
  scene::Material lamp = matt(0, 0, 0);
  lamp.emissive = {1000.F, 1000.F, 1000.F};
  const auto seen_at = [&](double x) {
    const auto scene = SceneMaker()
                           .add(test::box({-20, -20, -1}, {20, 20, 0}), glass(float(ior)))
                           .add(wall(0.02F), lamp, moved({x, 0.0, -4.0}))
                           .build();
    // Enters at (0, 0, 0), travels the slab, then 3 more in z at 45 degrees.
    return color_at(rendered(*scene, one_ray({-3, 0, 3}, {0, 0, 0}))).x > 500.F;
  };
  EXPECT_TRUE(seen_at(shift_in_slab + 3.0));
  EXPECT_FALSE(seen_at(shift_in_slab + 3.1));
  EXPECT_FALSE(seen_at(4.0));  // where it would be without glass
}

TEST(Whitted, inside_glass_flat_angles_are_mirrored_totally) {
  scene::Material lamp = matt(0, 0, 0);
  lamp.emissive = {1000.F, 1000.F, 1000.F};
  // A glowing ceiling above a block of glass, looked at from inside; the critical angle is 41.8 degrees.
  const auto scene = SceneMaker()
                         .add(test::box({-50, -9, -50}, {50, 0, 50}), glass())
                         .add(test::box({-500, 1, -500}, {500, 2, 500}), lamp)
                         .build();
  RenderSettings settings = one_ray({0, -1, 0}, {0.8, 0, 0});  // 38.7 degrees
  settings.max_depth = 1;
  EXPECT_GT(color_at(rendered(*scene, settings)).x, 500.F);
  settings = one_ray({0, -1, 0}, {1.0, 0, 0});  // 45 degrees
  settings.max_depth = 1;
  EXPECT_LT(color_at(rendered(*scene, settings)).x, 10.F);
}

TEST(Whitted, glass_lets_light_through_to_what_it_shades) {
  const scene::Light above = directional({0, 0, -1}, 100.0);
  const auto brightness = [&](const scene::Material& material) {
    const auto scene = SceneMaker()
                           .add(wall(5), matt(0.8F, 0.8F, 0.8F))
                           .add(test::box({-1, -1, 1}, {1, 1, 2}), material)
                           .light(above)
                           .build();
    const Film film = rendered(*scene, one_ray({4, 0, 0.5}, {0, 0, 0}));
    return film.exposure * color_at(film).y;
  };
  EXPECT_GT(brightness(glass()), 0.3F);
  EXPECT_LT(brightness(matt(1, 1, 1)), 0.6F * brightness(glass()));
}

TEST(Whitted, surfaces_that_face_the_light_never_shade_themselves) {
  // Everything that a camera sees is lit by a light from the camera, at any scale and place.
  for (const double offset : {0.0, 1e3, 1e7}) {
    for (const double scale : {1e-4, 1.0, 1e5}) {
      Affine place;
      place.linear = Mat3d(scale);
      place.translation = {offset, -offset, offset};
      const auto scene = SceneMaker()
                             .add(test::jittered_icosphere(3, 5), matt(1, 1, 1), place)
                             .light(directional({0, 0, -1}, 1.0))
                             .build();
      RenderSettings settings = from_front(1.2 * scale, 60, 5.0 * scale);
      settings.camera.world_from_camera.translation += place.translation;
      settings.layers = {LayerKind::kNormal};
      const Film film = rendered(*scene, settings);
      std::size_t covered = 0, dark = 0;
      for (std::size_t i = 0; i < 3600; ++i) {
        const float cosine = film.find("normal")->values[3 * i + 2];
        if (!(cosine > 0.05F)) continue;
        ++covered;
        // The matt part alone reflects at least 0.9 * cosine / pi.
        if (color_at(film, int(i % 60), int(i / 60)).y < 0.28F * cosine) ++dark;
      }
      EXPECT_GT(covered, 1500U) << offset << ' ' << scale;
      EXPECT_EQ(dark, 0U) << offset << ' ' << scale;
    }
  }
}

TEST(Whitted, smooth_normals_leave_no_facets_of_shadow_at_the_terminator) {
  mesh::TriangleMesh sphere = test::icosphere(1);
  sphere.normals = mesh::smooth_normals(sphere);
  const auto scene =
      SceneMaker().add(sphere, matt(1, 1, 1)).light(directional({-1, 0, 0}, std::numbers::pi)).build();
  RenderSettings settings = from_front(1.0, 100);
  const Film film = rendered(*scene, settings);
  std::size_t blocked = 0, checked = 0;
  for (int y = 0; y < 100; ++y) {
    for (int x = 50; x < 100; ++x) {
      const double px = (x + 0.5) / 50.0 - 1.0, py = 1.0 - (y + 0.5) / 50.0;
      // Near the lit side of the terminator, away from the rim: cosine of light is about px.
      if (px < 0.08 || px > 0.3 || px * px + py * py > 0.7) continue;
      ++checked;
      const float ambient = film.exposure * color_at(film, 5, 50).y;  // the dark side of the sphere
      if (film.exposure * color_at(film, x, y).y < ambient + 0.3F * float(px) * film.exposure) ++blocked;
    }
  }
  EXPECT_GT(checked, 500U);
  EXPECT_EQ(blocked, 0U);
}

// The light stands askew to the mesh, so that the terminator crosses facets in every way: a coarse sphere is
// lit wherever its smooth normals face the light.
TEST(Whitted, smooth_shadows_hold_where_the_light_is_askew_to_the_mesh) {
  mesh::TriangleMesh sphere = test::icosphere(2);
  sphere.normals = mesh::smooth_normals(sphere);
  const Vec3d to_light = glm::normalize(Vec3d(1.0, 0.37, -0.21));
  const auto scene =
      SceneMaker().add(sphere, matt(1, 1, 1)).light(directional(-to_light, std::numbers::pi)).build();
  const RenderSettings settings = from_front(1.0, 160);
  const Film film = rendered(*scene, settings);
  const float ambient = film.exposure * color_at(film, 12, 80).y;  // the dark side
  std::size_t blocked = 0, checked = 0;
  for (int y = 0; y < 160; ++y) {
    for (int x = 0; x < 160; ++x) {
      const double px = (x + 0.5) / 80.0 - 1.0, py = 1.0 - (y + 0.5) / 80.0;
      if (px * px + py * py > 0.6) continue;
      const double cosine = glm::dot(Vec3d(px, py, std::sqrt(1.0 - px * px - py * py)), to_light);
      if (cosine < 0.1 || cosine > 0.35) continue;
      ++checked;
      blocked += std::size_t(film.exposure * color_at(film, x, y).y <
                             ambient + 0.3F * float(cosine) * film.exposure);
    }
  }
  EXPECT_GT(checked, 1500U);
  EXPECT_EQ(blocked, 0U);
}

// A room whose walls are 1e-13 of its size thick, at any place: no light from outside comes in, and outside
// no point shades itself. Pictures of one plane, so every pixel is as bright as any other.
TEST(Whitted, thin_walls_keep_the_light_out_and_do_not_shade_themselves) {
  const auto brightness = [](double offset, double thickness, double eye) {
    Affine inner = moved(Vec3d(offset)), outer = inner;
    outer.linear = Mat3d(1.0 + thickness);
    const mesh::TriangleMesh box = test::box({-1, -1, -1}, {1, 1, 1});
    const auto scene = SceneMaker()
                           .add(box, matt(1, 1, 1), inner)
                           .add(box, matt(1, 1, 1), outer)
                           .light(directional({0.3, -0.5, -1.0}, 1.0))
                           .build();
    RenderSettings settings = from_front(0.95, 48, eye);
    settings.camera.world_from_camera.translation += Vec3d(offset);
    const Film film = rendered(*scene, settings);
    std::pair<float, float> range{1e30F, 0.F};
    for (int i = 0; i < 48 * 48; ++i) {
      const float green = color_at(film, i % 48, i / 48).y;
      range = {std::min(range.first, green), std::max(range.second, green)};
    }
    return range;
  };
  for (const double offset : {0.0, 1e4}) {
    const auto dark = brightness(offset, 0.5, 0.5);
    const auto inside = brightness(offset, std::max(1e-13, 1e-14 * offset), 0.5);
    EXPECT_EQ(inside, dark) << "light leaks in at " << offset;
    const auto outside = brightness(offset, std::max(1e-13, 1e-14 * offset), 5.0);
    EXPECT_EQ(outside.second, outside.first) << "shadows of its own at " << offset;
    EXPECT_GT(outside.first, 0.25F);
  }
}

TEST(Whitted, nested_glass_with_many_bounces_ends) {
  SceneMaker maker;
  for (int i = 1; i <= 8; ++i) maker.add(test::icosphere(2, 0.12F * float(i)), glass(1.1F + 0.1F * float(i)));
  RenderSettings settings = from_front(1.0, 12);
  settings.max_depth = 64;
  const Film film = rendered(*maker.build(), settings);
  for (const float value : film.find("color")->values) EXPECT_TRUE(std::isfinite(value));
}

TEST(Exposure, pictures_look_the_same_whatever_the_unit_of_the_lights) {
  const auto levels = [](double lux) {
    const auto scene = SceneMaker()
                           .add(test::icosphere(3), matt(0.5F, 0.5F, 0.5F))
                           .light(directional({-1, -1, -1}, lux))
                           .build();
    const Film film = rendered(*scene, from_front(1.5, 40));
    return film.exposure * color_at(film, 22, 18);
  };
  const Vec3f bright = levels(1e5);
  EXPECT_GT(bright.y, 0.2F);
  EXPECT_LT(bright.y, 1.F);
  expect_color(levels(1e-6), bright, 1e-3F);
  expect_color(levels(683.0), bright, 1e-3F);
}

TEST(Exposure, lights_that_reach_nothing_leave_the_default_picture) {
  SceneMaker maker;
  maker.add(wall(1), matt(0.5F, 0.5F, 0.5F));
  const RenderSettings settings = one_ray({0, 0, 5}, {0.1, 0.1, 0});
  const Vec3f plain = color_at(rendered(*maker.build(), settings));
  maker.light(directional({0, 0, 1}, 100.0));  // shines on the back
  expect_color(color_at(rendered(*maker.build(), settings)), plain);
}

TEST(Illuminate, follows_the_inverse_square_the_range_and_the_cone) {
  scene::Light light;
  light.kind = scene::LightKind::kPoint;
  light.intensity = 8.0;
  light.position = {0, 3, 0};
  EXPECT_FLOAT_EQ(illuminate(light, {0, 1, 0}).irradiance.x, 2.F);
  EXPECT_FLOAT_EQ(illuminate(light, {4, 0, 0}).irradiance.x, 8.F / 25.F);
  light.range = 2.0;
  EXPECT_EQ(illuminate(light, {0, 1, 0}).irradiance.x, 0.F);
  EXPECT_GT(illuminate(light, {0, 2, 0}).irradiance.x, 7.F);
  light.range.reset();

  light.kind = scene::LightKind::kSpot;
  light.direction = {0, -1, 0};
  light.inner_cone_rad = 0.2;
  light.outer_cone_rad = 0.4;
  EXPECT_FLOAT_EQ(illuminate(light, {0, 1, 0}).irradiance.x, 2.F);
  EXPECT_EQ(illuminate(light, {2.0 * std::tan(0.41), 1, 0}).irradiance.x, 0.F);
  const float between = illuminate(light, {2.0 * std::tan(0.3), 1, 0}).irradiance.x;
  EXPECT_GT(between, 0.F);
  EXPECT_LT(between, 1.9F);
  EXPECT_EQ(illuminate(light, {0, 5, 0}).irradiance.x, 0.F);
  EXPECT_EQ(illuminate(light, light.position).irradiance.x, 0.F);
}

}  // namespace
}  // namespace gridcast::render
