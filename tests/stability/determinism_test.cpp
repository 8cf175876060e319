// The same bits through every door: threads, orders, batches of any length, versions, pictures, compilers.

#include <atomic>
#include <bit>
#include <cmath>
#include <fstream>
#include <numeric>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "core/math/instruction_set.h"
#include "core/render/camera.h"
#include "core/render/render.h"
#include "core/scene/all_hits.h"
#include "core/scene/update.h"
#include "tests/stability/subject.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::stability {
namespace {

SceneSpec crowd(std::uint64_t seed) {
  SceneSpec spec;
  spec.meshes = {generated("jittered_icosphere 3 39"), generated("torus 24 16"),
                 generated("soup 300 39 0.3")};
  test::Random random(seed);
  for (int i = 0; i < 60; ++i)
    spec.instances.push_back({random.below(3), scene::random_affine(random, 4.0, 0.7)});
  return spec;
}

std::shared_ptr<const scene::Scene> built_as(const SceneSpec& spec, blas::StructureKind kind) {
  scene::SceneBuildOptions options;
  options.blas.kind = kind;
  return scene::build_scene(scene_data(spec), options).value();
}

/// The wide BVH, which has packets.
std::shared_ptr<const scene::Scene> in_wide_bvh(const SceneSpec& spec) {
  return built_as(spec, blas::StructureKind::kWideBvh);
}

/// Rays towards a scene; every seventh is invalid where `holes` are wanted.
enum class Holes : std::uint8_t { kNone, kInvalidRays };
std::vector<Ray> rays_at(const scene::Scene& scene, std::size_t count, Holes holes, test::Random& random) {
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    rays.push_back(scene::random_ray(scene, random));
    if (holes == Holes::kInvalidRays && i % 7 == 3) rays.back().direction.y = std::nan("");
  }
  return rays;
}

HitColumns closest(const scene::Scene& scene, const std::vector<Ray>& rays,
                   scene::TraceStats* stats = nullptr, Precision precision = Precision::kRobust) {
  scene::TraceOptions options;
  options.stats = stats;
  options.precision = precision;
  std::vector<double> rows;
  for (const Ray& r : rays)
    for (const double x :
         {r.origin.x, r.origin.y, r.origin.z, r.tnear, r.direction.x, r.direction.y, r.direction.z, r.tfar})
      rows.push_back(x);
  return scene::intersect(scene, {std::as_bytes(std::span(rows)), ScalarType::kFloat64, 8, {}}, options)
      .value();
}

/// Row i of `got` is row j of `want` to the bit.
bool same_row(const HitColumns& got, std::size_t i, const HitColumns& want, std::size_t j) {
  bool same = got.status[i] == want.status[j] &&
              std::bit_cast<std::uint64_t>(got.t[i]) == std::bit_cast<std::uint64_t>(want.t[j]) &&
              got.instance_id[i] == want.instance_id[j] && got.mesh_id[i] == want.mesh_id[j] &&
              got.primitive_id[i] == want.primitive_id[j];
  for (std::size_t c = 0; c < 2; ++c) same = same && got.uv[2 * i + c] == want.uv[2 * j + c];
  for (std::size_t c = 0; c < 3; ++c) same = same && got.normal[3 * i + c] == want.normal[3 * j + c];
  return same;
}

// Built and asked on 1, 2, 4 and 8 threads, with the rays in another order.
TEST(Stability, RC39_ThreadsAndOrders) {
  Row row(39, 16000);
  const SceneSpec spec = crowd(39);
  // As many threads as asked for, however few cores there are.
  const tbb::global_control more(tbb::global_control::max_allowed_parallelism, 8);
  const auto first = in_wide_bvh(spec);
  row.blocks(row.rays(), [&](test::Random& random, std::size_t count) {
    const std::vector<Ray> rays = rays_at(*first, count, Holes::kNone, random);
    const HitColumns want = closest(*first, rays);
    std::vector<std::size_t> order(count);
    std::iota(order.begin(), order.end(), 0U);
    for (const int threads : {1, 2, 4, 8}) {
      for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[random.below(std::uint32_t(i))]);
      std::vector<Ray> shuffled;
      for (const std::size_t i : order) shuffled.push_back(rays[i]);
      HitColumns got;
      tbb::task_arena(threads).execute([&] { got = closest(*in_wide_bvh(spec), shuffled); });
      for (std::size_t i = 0; i < count; ++i)
        if (!same_row(got, i, want, order[i]))
          row.fail(spec, {shuffled[i], {}, {}},
                   "answers otherwise on " + std::to_string(threads) + " threads");
    }
    row.count(count, 4 * count);
  });
}

/// From one place to a small part of a mesh of size 1 around the origin, as packets want them; every seventh
/// ray is invalid.
std::vector<Ray> neighbours(std::size_t count, test::Random& random) {
  const Vec3d origin = 5.0 * random.direction(), target = random.in_box(0.8);
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    rays.push_back({origin, target + random.in_box(0.05) - origin});
    if (i % 7 == 3) rays.back().tnear = std::nan("");
    if (i % 5 == 2) rays.back().tfar = random.uniform(0.5, 1.2);
  }
  return rays;
}

/// From now on as wide as before; ends with the scope.
class InstructionSetScope {
 public:
  InstructionSetScope() : before_(instruction_set()) {}
  ~InstructionSetScope() { EXPECT_TRUE(limit_instruction_set(before_)); }
  InstructionSetScope(const InstructionSetScope&) = delete;
  InstructionSetScope& operator=(const InstructionSetScope&) = delete;

 private:
  std::string before_;
};

// Built and asked with every instruction set of this machine, in packets and one by one, in every precision.
TEST(Stability, RC39_InstructionSets) {
  Row row(39, 8000);
  const InstructionSetScope scope;
  const SceneSpec specs[] = {crowd(391), placed(generated("jittered_icosphere 3 392"))};
  std::uint64_t in_packets = 0;
  for (const SceneSpec& spec : specs) {
    const bool alone = spec.instances.size() == 1;
    row.blocks(row.rays(), [&](test::Random& random, std::size_t count) {
      for (const blas::StructureKind kind : {blas::StructureKind::kWideBvh, blas::StructureKind::kCompactBvh,
                                             blas::StructureKind::kBvh, blas::StructureKind::kKdTree}) {
        const auto native = built_as(spec, kind);
        const std::vector<Ray> rays =
            alone ? neighbours(count, random) : rays_at(*native, count, Holes::kInvalidRays, random);
        for (const Precision precision : {Precision::kFast, Precision::kRobust, Precision::kExact}) {
          ASSERT_TRUE(limit_instruction_set(kNativeInstructionSet));
          const HitColumns want = closest(*native, rays, nullptr, precision);
          for (const std::string_view set : instruction_sets()) {
            ASSERT_TRUE(limit_instruction_set(set));
            scene::TraceStats stats;
            const HitColumns got = closest(*built_as(spec, kind), rays, &stats, precision);
            in_packets += stats.packet_rays;
            for (std::size_t i = 0; i < count; ++i)
              if (!same_row(got, i, want, i))
                row.fail(spec, {rays[i], {}, {}}, "answers otherwise with " + std::string(set));
            row.count(0, count);
          }
        }
      }
      row.count(count, 0);
    });
  }
  EXPECT_GT(in_packets, row.rays()) << "too few rays were traced in packets";
}

// Batches of 1 to 99 rays, of which some are invalid: what a lane of a packet answers is what its ray does.
TEST(Stability, RC41_RaggedBatches) {
  Row row(41, 9900);
  const SceneSpec specs[] = {crowd(41), placed(generated("jittered_icosphere 3 41"))};
  std::uint64_t in_packets = 0;
  for (const SceneSpec& spec : specs) {
    const auto scene = in_wide_bvh(spec);
    const bool alone = spec.instances.size() == 1;
    row.blocks(row.rays(99 * 50), [&](test::Random& random, std::size_t turns) {
      for (std::size_t turn = 0; turn < turns; ++turn) {
        for (std::size_t count = 1; count <= 99; ++count) {
          const std::vector<Ray> rays =
              alone ? neighbours(count, random) : rays_at(*scene, count, Holes::kInvalidRays, random);
          scene::TraceStats stats;
          const HitColumns got = closest(*scene, rays, &stats);
          in_packets += stats.packet_rays;
          HitColumns want;
          want.resize(count, HitField::kAll);
          for (std::size_t i = 0; i < count; ++i) want.set(i, scene::intersect(*scene, rays[i]));
          for (std::size_t i = 0; i < count; ++i)
            if (!same_row(got, i, want, i))
              row.fail(spec, {rays[i], {}, {}}, "a lane of " + std::to_string(count) + " answers otherwise");
          row.count(count, count);
        }
      }
    });
  }
  EXPECT_GT(in_packets, row.rays() / 10) << "too few rays were traced in packets";
}

// While a thread moves all instances at once, again and again, every batch sees one version, whole.
TEST(Stability, RC42_UpdatesDuringQueries) {
  Row row(42, 20000);
  constexpr int kSide = 16;
  SceneSpec spec;
  spec.meshes = {generated("quad_grid 1 1")};
  for (int i = 0; i < kSide * kSide; ++i)
    spec.instances.push_back({0, {Mat3d(1.0), Vec3d(2 * (i % kSide), 2.0 * (i / kSide), 0.0)}});
  std::vector<Ray> rays;
  for (const Placement& placement : spec.instances)
    rays.push_back({placement.world_from_object.translation + Vec3d(0.25, 0.5, 1e6), Vec3d(0.0, 0.0, -1.0)});
  std::atomic<std::shared_ptr<const scene::Scene>> current = in_wide_bvh(spec);
  std::jthread writer([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      const auto old = current.load();
      std::vector<scene::SceneEdit> edits;
      for (std::uint32_t id = 0; id < spec.instances.size(); ++id) {
        Affine where = spec.instances[id].world_from_object;
        where.translation.z = double(old->version());  // version - 1 of the scene that comes
        edits.emplace_back(scene::MoveInstance{id, where});
      }
      current.store(scene::apply_update(*old, edits).value().scene);
    }
  });
  for (std::size_t done = 0; done < row.rays(); done += rays.size()) {
    const auto snapshot = current.load();
    const HitColumns hits = closest(*snapshot, rays);
    for (std::size_t i = 0; i < rays.size(); ++i)
      if (hits.instance_id[i] != i || hits.t[i] != 1e6 - double(snapshot->version() - 1))
        row.fail("version " + std::to_string(snapshot->version()) + " answers t " +
                 std::to_string(hits.t[i]));
    row.count(rays.size(), rays.size());
  }
  writer.request_stop();
  writer.join();
  EXPECT_GT(current.load()->version(), 3U) << "nothing was updated meanwhile";
}

// A pixel's ray through the doors of the core: alone, in a batch, any, all, counted, and the layers of a
// picture.
TEST(Stability, RC43_TheSameThroughEveryDoor) {
  Row row(43, 8192);
  const SceneSpec spec = crowd(43);
  const auto scene = in_wide_bvh(spec);
  const int side = std::max(8, int(std::sqrt(double(std::min<std::size_t>(row.rays(), 1U << 22)))));
  render::RenderSettings settings;
  settings.camera = render::frame(scene->bounds(), 0.8, 1.0);
  settings.width_px = settings.height_px = side;
  settings.integrator = render::Integrator::kDepth;
  settings.layers = {render::LayerKind::kInstanceId, render::LayerKind::kMeshId,
                     render::LayerKind::kPrimitiveId};
  const render::Film film = render::render(*scene, settings).value();
  std::vector<Ray> rays;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      rays.push_back(render::primary_ray(settings.camera, side, side, x + 0.5, y + 0.5));
  const HitColumns columns = closest(*scene, rays);
  std::vector<double> rows;
  for (const Ray& r : rays)
    for (const double n : {r.origin.x, r.origin.y, r.origin.z, r.direction.x, r.direction.y, r.direction.z})
      rows.push_back(n);
  const RayBatch batch{std::as_bytes(std::span(rows)), ScalarType::kFloat64, 6, {}};
  const auto any = scene::occluded(*scene, batch, {}).value();
  const HitLists all = scene::intersect_all(*scene, batch, {}).value();
  const HitCounts counts = scene::count_hits(*scene, batch, {}).value();
  std::size_t hits = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const SurfaceHit alone = scene::intersect(*scene, rays[i]);
    HitColumns one;
    one.resize(1, HitField::kAll);
    one.set(0, alone);
    const std::size_t first = all.splits[i], listed = all.splits[i + 1] - first;
    const bool hit = alone.status == RayStatus::kHit;
    hits += std::size_t(hit);
    const bool listed_first =
        !hit || (all.hits.t[first] == alone.t && all.hits.instance_id[first] == alone.instance_id &&
                 all.hits.primitive_id[first] == alone.primitive_id);
    const Shot shot{rays[i], {}, {}};
    if (!same_row(columns, i, one, 0)) row.fail(spec, shot, "the batch answers otherwise than the ray");
    if (any[i] != alone.status) row.fail(spec, shot, "any answers otherwise than the closest");
    if ((listed > 0) != hit || !listed_first)
      row.fail(spec, shot, "the first of all hits is not the closest");
    if (counts.count[i] != listed) row.fail(spec, shot, "as many are counted as are not listed");
    if (film.find("instance_id")->ids[i] != alone.instance_id ||
        film.find("mesh_id")->ids[i] != alone.mesh_id ||
        film.find("primitive_id")->ids[i] != alone.primitive_id ||
        film.find("depth")->values[i] != float(alone.t))
      row.fail(spec, shot, "the picture shows something else");
  }
  EXPECT_GT(hits, rays.size() / 10);
  row.count(rays.size(), 6 * rays.size());
}

// Products and sums are rounded one by one, and NaN and infinity are what they are.
TEST(Stability, RC40_CompilerFlags) {
  Row row(40, 1);
  std::ifstream file(GRIDCAST_COMPILE_COMMANDS);
  ASSERT_TRUE(file) << GRIDCAST_COMPILE_COMMANDS;
  std::size_t engine = 0;
  for (const auto& entry : nlohmann::json::parse(file)) {
    const std::string command = entry.at("command"), source = entry.at("file");
    engine += std::size_t(source.find("/core/") != std::string::npos);
    if (command.find("-ffp-contract=off") == std::string::npos)
      row.fail(source + " may contract products and sums");
    for (const char* flag : {"-ffast-math", "-Ofast", "-funsafe-math", "-ffinite-math", "-fassociative-math",
                             "-freciprocal-math", "-fno-signed-zeros", "-mfpmath=387", "-march=native"})
      if (command.find(flag) != std::string::npos) row.fail(source + " is compiled with " + flag);
  }
  EXPECT_GT(engine, 50U);
  // And what came of the flags: a product that a fused step would not round. Denormals count.
  volatile double a = 1.0 + 0x1p-30, b = -(1.0 + 0x1p-29), tiny = 0x1p-1022;
  EXPECT_EQ(a * a + b, 0.0);
  EXPECT_GT(tiny * 0.5, 0.0);
}

}  // namespace
}  // namespace gridcast::stability
