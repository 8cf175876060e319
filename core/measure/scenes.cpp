#include "core/measure/scenes.h"

#include <array>
#include <cmath>

#include "core/measure/meshes.h"
#include "core/measure/random.h"

namespace gridcast::measure {
namespace {

using mesh::TriangleMesh;

std::size_t scaled(double count, double size) {
  return std::size_t(std::max(1.0, std::round(count * size)));
}

BenchScene single(TriangleMesh mesh, const View& view) {
  BenchScene scene;
  scene.data.meshes.push_back(std::make_shared<const TriangleMesh>(std::move(mesh)));
  scene.data.deformations.emplace_back();
  scene.data.instances.push_back({.name = {}, .world_from_object = {}, .mesh_id = 0});
  scene.view = view;
  return scene;
}

void place(BenchScene& scene, const Vec3d& at, double scale, const Mat3d& rotation) {
  scene.data.instances.push_back({.name = {}, .world_from_object = {scale * rotation, at}, .mesh_id = 0});
}

BenchScene empty_of(TriangleMesh mesh, const View& view) {
  BenchScene scene = single(std::move(mesh), view);
  scene.data.instances.clear();
  return scene;
}

/// I1: a cubic lattice, half a spacing of jitter, any rotation, half to full size.
BenchScene lattice(std::uint64_t seed, double size) {
  constexpr double kSpacing = 2.0;
  const std::size_t count = scaled(10'000, size);
  const auto side = std::size_t(std::ceil(std::cbrt(double(count))));
  const double extent = kSpacing * double(side);
  BenchScene scene = empty_of(organic_mesh(scaled(69'000, size), seed),
                              {{1.6 * extent, 1.1 * extent, 1.9 * extent}, Vec3d(0.45 * extent)});
  Random random(seed + 100);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t row = i / side, layer = row / side;
    const Vec3d cell{double(i % side), double(row % side), double(layer)};
    place(scene, kSpacing * (cell + random.in_box(0.25)), random.uniform(0.5, 1.0), random.rotation());
  }
  return scene;
}

/// I2: a forest, trees upright, turned and scaled.
BenchScene forest(std::uint64_t seed, double size) {
  const std::size_t count = scaled(1'000'000, size);
  const auto side = std::size_t(std::ceil(std::sqrt(double(count))));
  const double extent = double(side);
  BenchScene scene = empty_of(tree_mesh(1000, seed), {{0.5 * extent, 0.06 * extent + 2.0, -0.05 * extent},
                                                      {0.5 * extent, 0.0, 0.35 * extent}});
  Random random(seed + 200);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t row = i / side;
    const Vec3d at{double(i % side) + random.uniform(-0.4, 0.4), random.uniform(-0.1, 0.1),
                   double(row) + random.uniform(-0.4, 0.4)};
    const double angle = random.uniform(0.0, 6.28318530717958647692);
    const double c = std::cos(angle), s = std::sin(angle);
    place(scene, at, random.uniform(0.6, 1.2), {{c, 0.0, -s}, {0.0, 1.0, 0.0}, {s, 0.0, c}});
  }
  return scene;
}

/// I3: a teapot in a stadium. 99 of 100 instances in a tenth of each side, the camera looks past them.
BenchScene stadium(std::uint64_t seed, double size) {
  constexpr double kSide = 400.0;
  const std::size_t count = scaled(10'000, size);
  BenchScene scene = empty_of(organic_mesh(scaled(69'000, size), seed),
                              {{0.62 * kSide, 0.56 * kSide, 0.66 * kSide}, Vec3d(0.5 * kSide)});
  Random random(seed + 300);
  for (std::size_t i = 0; i < count; ++i) {
    const bool crowded = i % 100 != 0;
    const Vec3d at = Vec3d(0.5 * kSide) + random.in_box(crowded ? 0.05 * kSide : 0.5 * kSide);
    place(scene, at, random.uniform(0.3, 0.8), random.rotation());
  }
  return scene;
}

BenchScene make_s1(std::uint64_t seed, double size) {
  return single(organic_mesh(scaled(69'000, size), seed), {{0.8, 0.7, 2.8}, {0, 0, 0}});
}
BenchScene make_s2(std::uint64_t seed, double size) {
  return single(scan_mesh(scaled(268'000, size), seed), {{0.9, 0.5, 3.0}, {0, 0, 0}});
}
BenchScene make_s3(std::uint64_t seed, double size) {
  return single(terrain_mesh(scaled(2'000'000, size), seed),
                {{-1.1, 0.8, -1.1}, {0.1, -0.1, 0.1}, {0, 1, 0}, 50.0});
}
BenchScene make_s4(std::uint64_t seed, double size) {
  return single(hall_mesh(scaled(324'000, size), seed),
                {{2.6, 3.0, 2.7}, {36.0, 4.5, 12.0}, {0, 1, 0}, 60.0, Vec3d{7.5, 6.0, 5.3}});
}
BenchScene make_s5(std::uint64_t seed, double size) {
  return single(soup_mesh(scaled(1'000'000, size), seed), {{1.3, 1.1, 2.1}, Vec3d(0.5)});
}
BenchScene make_s6(std::uint64_t seed, double size) {
  return single(hair_mesh(scaled(500'000, size), seed), {{0.5, 0.8, 4.0}, {0, -0.1, 0}});
}
BenchScene make_w1(std::uint64_t seed, double size) {
  return single(overlapping_mesh(scaled(20'000, size), seed), {{0.4, 0.6, 3.2}, {0, 0, 0}});
}
BenchScene make_w2(std::uint64_t seed, double size) {
  return single(huge_triangle_mesh(scaled(268'000, size), seed), {{0.9, 0.5, 3.0}, {0, 0, 0}});
}
BenchScene make_w3(std::uint64_t seed, double size) {
  return single(fan_mesh(scaled(1'000'000, size), seed), {{0.5, 1.4, 1.9}, {0, 0, 0}});
}
BenchScene make_w4(std::uint64_t seed, double size) {
  return single(flat_mesh(scaled(1'000'000, size), seed), {{0.3, 1.6, 1.6}, {0, 0, 0}});
}

BenchScene make_w5(std::uint64_t seed, double size) {
  return single(needles_mesh(scaled(20'000, size), seed), {{2.0, 3.0, 5.0}, {0, 0, 0}});
}

/// H1: closed bodies drawn out to slivers of 1,000 : 1, turned, far from the world's origin: what is left of
/// a float there is coarser than the slivers are wide.
BenchScene make_h1(std::uint64_t seed, double size) {
  const Vec3d far{40'000.0, -60'000.0, 80'000.0};
  TriangleMesh body = organic_mesh(scaled(4000, size), seed);
  for (Vec3f& p : body.positions) p = {100.F * p.x, 0.1F * p.y, p.z};
  BenchScene scene = empty_of(std::move(body), {far + Vec3d{150.0, 110.0, 260.0}, far});
  Random random(seed + 800);
  for (int i = 0; i < 24; ++i) {
    const Vec3d at = far + random.in_box(40.0);
    place(scene, at, random.uniform(0.5, 1.0), random.rotation());
  }
  return scene;
}

struct Maker {
  SceneEntry entry;
  BenchScene (*make)(std::uint64_t seed, double size);
};

constexpr std::array kMakers{
    Maker{{"S1", "organic body, 69 k triangles"}, make_s1},
    Maker{{"S2", "scan, 268 k"}, make_s2},
    Maker{{"S3", "fractal terrain, 2 M"}, make_s3},
    Maker{{"S4", "pillared hall, camera inside, 324 k, many long and thin"}, make_s4},
    Maker{{"S5", "soup of small triangles, 1 M"}, make_s5},
    Maker{{"S6", "hair, 500 k thin triangles"}, make_s6},
    Maker{{"I1", "10,000 instances of S1 on a jittered lattice"}, lattice},
    Maker{{"I2", "1,000,000 instances of a tree in a flat slab"}, forest},
    Maker{{"I3", "10,000 instances of S1, 99 % of them in 0.1 % of the volume"}, stadium},
    Maker{{"W1", "20,000 triangles that all overlap"}, make_w1},
    Maker{{"W2", "S2 and one huge triangle"}, make_w2},
    Maker{{"W3", "fan of 1 M needles"}, make_w3},
    Maker{{"W4", "1 M triangles in one plane"}, make_w4},
    Maker{{"W5", "20,000 needles across a box in all directions"}, make_w5},
    Maker{{"H1", "hostile: 24 bodies of slivers far from the origin, 4 k triangles each"}, make_h1},
};

constexpr auto kCatalogue = [] {
  std::array<SceneEntry, kMakers.size()> entries;
  for (std::size_t i = 0; i < kMakers.size(); ++i) entries[i] = kMakers[i].entry;
  return entries;
}();

}  // namespace

std::span<const SceneEntry> scene_catalogue() {
  return kCatalogue;
}

Result<BenchScene> make_scene(std::string_view name, std::uint64_t seed, double size) {
  for (const Maker& maker : kMakers) {
    if (maker.entry.name != name) continue;
    BenchScene scene = maker.make(seed, size);
    scene.name = name;
    return scene;
  }
  return Error{ErrorCode::kNotFound, "there is no scene '" + std::string(name.substr(0, 40)) + "'", "/scene"};
}

BenchScene framed_scene(std::string name, scene::SceneData data, const Bounds3d& bounds) {
  BenchScene scene{std::move(name), std::move(data), {}};
  const double radius = bounds.empty() ? 1.0 : 0.5 * glm::length(bounds.extent());
  const Vec3d center = bounds.empty() ? Vec3d(0.0) : bounds.center();
  scene.view.target = center;
  scene.view.eye = center + 2.2 * radius * glm::normalize(Vec3d{0.6, 0.45, 1.0});
  return scene;
}

scene::SceneData first_mesh(const scene::SceneData& data) {
  scene::SceneData alone;
  alone.meshes = {data.meshes[0]};
  alone.deformations.resize(1);
  alone.instances.push_back({.name = {}, .world_from_object = {}, .mesh_id = 0});
  return alone;
}

bool is_single_mesh(const scene::SceneData& data) {
  return data.instances.size() == 1 && data.instances[0].world_from_object == Affine{};
}

}  // namespace gridcast::measure
