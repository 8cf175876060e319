#include "core/render/render.h"

#include <atomic>
#include <numbers>

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "core/render/exposure.h"
#include "core/render/sampling.h"
#include "core/render/sky.h"
#include "core/render/whitted.h"
#include "core/scene/trace.h"
#include "tests/unit/render/render_scene.h"

namespace gridcast::render {
namespace {

std::shared_ptr<const scene::Scene> two_objects() {
  return SceneMaker()
      .add(test::icosphere(2), matt(0.8F, 0.2F, 0.1F), moved({-0.7, 0.1, 0.0}))
      .add(test::box({-1, -1, -1}, {1, 1, 1}), mirror(), moved({1.2, -0.3, -1.0}))
      .build();
}

RenderSettings all_layers(int samples) {
  RenderSettings settings;
  settings.camera = look_at({1, 2, 6}, {0, 0, 0}, {0, 1, 0}, 0.6).value();
  settings.width_px = 61;
  settings.height_px = 43;
  settings.samples = samples;
  settings.layers = {LayerKind::kDepth, LayerKind::kNormal, LayerKind::kInstanceId, LayerKind::kMeshId,
                     LayerKind::kPrimitiveId};
  return settings;
}

TEST(Render, the_silhouette_and_depth_of_a_sphere_are_those_of_a_sphere) {
  const auto scene = SceneMaker().add(test::icosphere(5), matt(1, 1, 1)).build();
  RenderSettings settings = from_front(1.25, 250);
  settings.layers = {LayerKind::kDepth};
  const Film film = rendered(*scene, settings);
  std::size_t covered = 0;
  for (int y = 0; y < 250; ++y) {
    for (int x = 0; x < 250; ++x) {
      const std::size_t pixel = std::size_t(y * 250 + x);
      if (alpha_at(film, pixel) > 0.F) ++covered;
      const double px = (x + 0.5) / 100.0 - 1.25, py = 1.25 - (y + 0.5) / 100.0;
      const double r2 = px * px + py * py;
      // The mesh's faces (edges of 0.04) lie up to 0.0003 inside the sphere, seen at 26 degrees or more.
      if (r2 < 0.81) {
        EXPECT_NEAR(film.find("depth")->values[pixel], 5.0 - std::sqrt(1.0 - r2), 8e-4);
      }
    }
  }
  EXPECT_NEAR(double(covered) * 1e-4, std::numbers::pi, 0.02);
}

TEST(Render, layers_equal_the_same_rays_cast_one_by_one) {
  const auto scene = two_objects();
  const RenderSettings settings = all_layers(2);
  const Film film = rendered(*scene, settings);
  std::size_t hits = 0;
  for (int y = 0; y < settings.height_px; ++y) {
    for (int x = 0; x < settings.width_px; ++x) {
      const Ray ray = primary_ray(settings.camera, settings.width_px, settings.height_px, x + 0.5, y + 0.5);
      const SurfaceHit hit = scene::intersect(*scene, ray);
      const auto pixel = std::size_t(y * settings.width_px + x);
      hits += hit.status == RayStatus::kHit ? 1 : 0;
      EXPECT_EQ(film.find("depth")->values[pixel], float(hit.t));
      EXPECT_EQ(film.find("instance_id")->ids[pixel], hit.instance_id);
      EXPECT_EQ(film.find("mesh_id")->ids[pixel], hit.mesh_id);
      EXPECT_EQ(film.find("primitive_id")->ids[pixel], hit.primitive_id);
      for (std::size_t axis = 0; axis < 3; ++axis)
        EXPECT_EQ(film.find("normal")->values[3 * pixel + axis], float(hit.normal[int(axis)]));
    }
  }
  EXPECT_GT(hits, 300U);
}

TEST(Render, colours_equal_those_of_pixels_shaded_one_by_one) {
  const auto plain = two_objects();
  const auto lit = SceneMaker()
                       .add(test::jittered_icosphere(3, 4), mirror())
                       .add(test::box({-3, -2, -3}, {3, -1, 3}), matt(0.8F, 0.6F, 0.4F))
                       .light(directional({-1, -2, -0.5}, 900.0))
                       .light(directional({1, -1, -0.5}, 400.0))
                       .build();
  for (const auto& scene : {plain, lit}) {
    RenderSettings settings = all_layers(1);
    settings.camera = default_camera(*scene, 1.0);
    const Film film = rendered(*scene, settings);
    const Lighting lighting = light_scene(*scene, settings);
    const Whitted whitted(*scene, lighting, settings, settings.max_depth);
    const Samples<float>& values = film.find("color")->values;
    for (int y = 0; y < settings.height_px; ++y) {
      for (int x = 0; x < settings.width_px; ++x) {
        const glm::dvec2 offset = pixel_sample(std::uint32_t(x), std::uint32_t(y), 0, 1);
        const Ray ray =
            primary_ray(settings.camera, settings.width_px, settings.height_px, x + offset.x, y + offset.y);
        const Vec3f color = whitted.radiance(ray, scene::intersect(*scene, ray));
        const auto pixel = 4 * std::size_t(y * settings.width_px + x);
        for (std::size_t c = 0; c < 3; ++c) ASSERT_EQ(values[pixel + c], color[int(c)]) << x << ' ' << y;
      }
    }
  }
}

TEST(Render, the_bits_do_not_depend_on_the_number_of_threads) {
  const auto scene = two_objects();
  const RenderSettings settings = all_layers(3);
  Film one, two;
  tbb::task_arena(1).execute([&] { one = rendered(*scene, settings); });
  tbb::task_arena(2).execute([&] { two = rendered(*scene, settings); });
  for (std::size_t i = 0; i < one.layers.size(); ++i) {
    EXPECT_EQ(one.layers[i].values, two.layers[i].values) << one.layers[i].name;
    EXPECT_EQ(one.layers[i].ids, two.layers[i].ids) << one.layers[i].name;
  }
}

TEST(Render, pixels_at_the_rim_are_partly_covered_with_more_samples) {
  const auto scene = SceneMaker().add(test::icosphere(4), matt(1, 1, 1)).build();
  RenderSettings settings = from_front(2.0, 32);
  settings.samples = 16;
  const Film film = rendered(*scene, settings);
  double area = 0.0;
  std::size_t partly = 0;
  for (std::size_t i = 0; i < 32 * 32; ++i) {
    area += double(alpha_at(film, i)) / 64.0;
    if (alpha_at(film, i) > 0.F && alpha_at(film, i) < 1.F) ++partly;
  }
  EXPECT_NEAR(area, std::numbers::pi, 0.02);
  EXPECT_GT(partly, 30U);
}

TEST(Render, each_integrator_writes_its_own_layer_first_and_duplicates_once) {
  const auto scene = two_objects();
  RenderSettings settings = from_front(1.0, 4);
  const std::pair<Integrator, const char*> expected[] = {{Integrator::kWhitted, "color"},
                                                         {Integrator::kDepth, "depth"},
                                                         {Integrator::kNormal, "normal"},
                                                         {Integrator::kId, "instance_id"}};
  for (const auto& [integrator, name] : expected) {
    settings.integrator = integrator;
    settings.layers = {LayerKind::kDepth, LayerKind::kDepth};
    const Film film = rendered(*scene, settings);
    EXPECT_EQ(film.layers[0].name, name);
    EXPECT_EQ(film.layers.size(), integrator == Integrator::kDepth ? 1U : 2U);
  }
}

TEST(Render, settings_out_of_range_are_named) {
  const auto scene = two_objects();
  const auto where = [&](const auto& change) {
    RenderSettings settings = from_front(1.0, 4);
    change(settings);
    const auto film = render(*scene, settings);
    return film.ok() ? std::string() : film.error().where;
  };
  EXPECT_EQ(where([](RenderSettings& s) { s.width_px = 0; }), "/width_px");
  EXPECT_EQ(where([](RenderSettings& s) { s.width_px = 16385; }), "/width_px");
  EXPECT_EQ(where([](RenderSettings& s) { s.height_px = -1; }), "/height_px");
  EXPECT_EQ(where([](RenderSettings& s) { s.samples = 0; }), "/samples");
  EXPECT_EQ(where([](RenderSettings& s) { s.samples = 4097; }), "/samples");
  EXPECT_EQ(where([](RenderSettings& s) { s.max_depth = -1; }), "/max_depth");
  EXPECT_EQ(where([](RenderSettings& s) { s.max_depth = 65; }), "/max_depth");
  EXPECT_EQ(where([](RenderSettings& s) { s.camera.xmag = 0.0; }), "/camera");
  EXPECT_EQ(where([](RenderSettings&) {}), "");
}

TEST(Render, a_stop_request_ends_it_soon_with_cancelled) {
  const auto scene = two_objects();
  std::stop_source stop;
  RenderSettings settings = from_front(1.5, 512);
  std::atomic<int> calls{0};
  const auto film = render(*scene, settings, stop.get_token(), [&](double) {
    ++calls;
    stop.request_stop();
  });
  ASSERT_FALSE(film.ok());
  EXPECT_EQ(film.error().code, ErrorCode::kCancelled);
  EXPECT_LT(calls, 200);  // of 1000 for the whole picture
}

TEST(Render, progress_ends_at_one) {
  const auto scene = two_objects();
  std::atomic<int> finals{0};
  ASSERT_TRUE(render(*scene, from_front(1.5, 100), {}, [&](double fraction) {
                EXPECT_GT(fraction, 0.0);
                EXPECT_LE(fraction, 1.0);
                if (fraction == 1.0) ++finals;
              }).ok());
  EXPECT_EQ(finals, 1);
}

TEST(Render, names_are_read_back_and_unknown_ones_refused) {
  for (const Integrator i : {Integrator::kWhitted, Integrator::kDepth, Integrator::kNormal, Integrator::kId})
    EXPECT_EQ(parse_integrator(to_string(i)).value(), i);
  for (const LayerKind l : {LayerKind::kColor, LayerKind::kDepth, LayerKind::kNormal, LayerKind::kInstanceId,
                            LayerKind::kMeshId, LayerKind::kPrimitiveId})
    EXPECT_EQ(parse_layer(to_string(l)).value(), l);
  EXPECT_NE(parse_integrator("path").error().message.find("whitted"), std::string::npos);
  EXPECT_FALSE(parse_layer("").ok());
}

TEST(DefaultCamera, the_files_own_camera_is_used_unless_it_sees_nothing) {
  const scene::Camera good = look_at({0, 0, 5}, {0, 0, 0}, {0, 1, 0}, 0.5).value();
  const scene::Camera away = look_at({0, 0, 5}, {0, 0, 9}, {0, 1, 0}, 0.5).value();
  const scene::Camera too_close = look_at({0, 0, 1.0}, {0, 0, 0}, {0, 1, 0}, 0.01).value();
  scene::Camera broken = good;
  broken.yfov_rad = 0.0;
  SceneMaker maker;
  maker.add(test::icosphere(1), matt(1, 1, 1)).camera(broken).camera(away).camera(too_close);
  const scene::Camera framed = default_camera(*maker.build(), 1.5);
  EXPECT_EQ(scene::occluded(*maker.build(), primary_ray(framed, 3, 2, 1.5, 1.0)), RayStatus::kHit);
  EXPECT_FALSE(framed.world_from_camera == away.world_from_camera);
  EXPECT_FALSE(framed.world_from_camera == too_close.world_from_camera);
  EXPECT_EQ(default_camera(*maker.camera(good).build(), 1.5).world_from_camera, good.world_from_camera);
}

}  // namespace
}  // namespace gridcast::render
