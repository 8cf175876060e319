// The sections `build` and `refit`: trees of one mesh.

#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "core/measure/bench.h"
#include "core/measure/embree_yardstick.h"
#include "core/measure/interleave.h"

namespace gridcast::measure {
namespace {

/// The row of one contender and its tree, kept until the next run begins.
template <class Row>
struct TreeContender {
  Row row;
  std::optional<blas::Blas> ours;
  std::unique_ptr<EmbreeScene> theirs;
};

template <class Row>
Row row_of(const BenchScene& scene, std::size_t threads, const std::string& engine,
           const std::string& structure) {
  Row row;
  row.scene = scene.name;
  row.engine = engine;
  row.structure = structure;
  row.threads = threads;
  row.triangles = scene.data.meshes[0]->triangle_count();
  return row;
}

template <class Row>
const Samples& samples_of(const std::vector<TreeContender<Row>>& contenders, const std::vector<Timed>& timed,
                          std::string_view structure) {
  static const Samples none;
  for (std::size_t i = 0; i < contenders.size(); ++i)
    if (contenders[i].row.engine == "embree" && contenders[i].row.structure == structure)
      return timed[i].seconds;
  return none;
}

template <class Row>
void fill_speed(Row& row, const Samples& taken_s) {
  const double middle = median(taken_s);
  row.ms = 1000.0 * middle;
  row.mtriangles_per_s = middle > 0.0 ? double(row.triangles) / middle / 1e6 : 0.0;
  row.spread = spread(taken_s);
}

std::vector<blas::StructureKind> trees_of(const BenchOptions& options) {
  std::vector<blas::StructureKind> kinds;
  for (const blas::StructureKind kind : options.structures)
    if (kind != blas::StructureKind::kBruteForce) kinds.push_back(kind);
  return kinds;
}

using BuildContender = TreeContender<BuildRow>;

Timed timed_build(BuildContender& contender, const std::shared_ptr<const mesh::TriangleMesh>& mesh,
                  const blas::BuildOptions& how, const std::stop_token& stop) {
  Timed timed;
  timed.before = [&contender] { contender.ours.reset(); };
  timed.run = [&contender, mesh, how, stop] {
    auto built = blas::Blas::build(mesh, how, stop);
    if (!built) return Status(built.error());
    contender.ours = *std::move(built);
    return ok_status();
  };
  return timed;
}

Timed timed_build(BuildContender& contender, const scene::SceneData& data, const EmbreeOptions& options) {
  Timed timed;
  timed.before = [&contender] { contender.theirs.reset(); };
  timed.run = [&contender, &data, options] {
    auto built = EmbreeScene::build(data, options);
    if (!built) return Status(built.error());
    contender.theirs = *std::move(built);
    return ok_status();
  };
  return timed;
}

const std::vector<std::pair<std::string, EmbreeOptions>>& embree_builds() {
  static const std::vector<std::pair<std::string, EmbreeOptions>> builds{
      {"low", {.quality = EmbreeQuality::kLow}},
      {"medium", {.quality = EmbreeQuality::kMedium}},
      {"medium_compact", {.quality = EmbreeQuality::kMedium, .memory = EmbreeMemory::kCompact}},
      {"robust", {.quality = EmbreeQuality::kMedium, .mode = EmbreeMode::kRobust}},
      {"high", {.quality = EmbreeQuality::kHigh}}};
  return builds;
}

/// What is built of ours, by name: every kind, the BVHs once more in Morton order, and the wide one without
/// triangles in several leaves, as Embree's of medium quality are.
std::vector<std::pair<std::string, blas::BuildOptions>> our_builds(const BenchOptions& options) {
  std::vector<std::pair<std::string, blas::BuildOptions>> builds;
  for (const blas::StructureKind kind : trees_of(options)) {
    const std::string name(blas::to_string(kind));
    builds.push_back({name, {.kind = kind}});
    if (kind == blas::StructureKind::kWideBvh)
      builds.push_back({name + "_whole", {.kind = kind, .spatial = blas::SpatialSplits::kNever}});
    if (kind == blas::StructureKind::kWideBvh || kind == blas::StructureKind::kCompactBvh ||
        kind == blas::StructureKind::kBvh)
      builds.push_back({name + "_fast", {.kind = kind, .quality = blas::BuildQuality::kFast}});
  }
  return builds;
}

double memory_bytes(const BuildContender& contender) {
  if (contender.ours) return double(contender.ours->stats().memory_bytes);
  return contender.theirs ? double(contender.theirs->memory_bytes()) : 0.0;
}

Status builds_on(std::size_t threads, const BenchScene& scene, const BenchOptions& options, Report& report,
                 const scene::ProgressCallback& progress) {
  const scene::SceneData data = first_mesh(scene.data);
  const auto ours = our_builds(options);
  std::vector<BuildContender> contenders;
  std::vector<Timed> timed;
  contenders.reserve(ours.size() + embree_builds().size());  // tasks point into it
  for (const auto& [name, how] : embree_builds()) {
    contenders.push_back({row_of<BuildRow>(scene, threads, "embree", name), {}, {}});
    timed.push_back(timed_build(contenders.back(), data, how));
  }
  for (const auto& [name, how] : ours) {
    contenders.push_back({row_of<BuildRow>(scene, threads, "gridcast", name), {}, {}});
    timed.push_back(timed_build(contenders.back(), data.meshes[0], how, options.stop));
  }
  if (Status status = interleave(timed, threads, clock_for(threads), options, progress); !status)
    return status;
  const Samples &medium = samples_of(contenders, timed, "medium"),
                &low = samples_of(contenders, timed, "low");
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    BuildRow& row = contenders[i].row;
    const double triangles = double(std::max<std::uint64_t>(1, row.triangles));
    fill_speed(row, timed[i].seconds);
    row.bytes_per_triangle = memory_bytes(contenders[i]) / triangles;
    row.mesh_bytes_per_triangle = double(data.meshes[0]->memory_bytes()) / triangles;
    row.vs_embree_medium = speedup(timed[i].seconds, medium);
    row.vs_embree_low = speedup(timed[i].seconds, low);
    report.build.push_back(row);
  }
  return ok_status();
}

using RefitContender = TreeContender<RefitRow>;

/// A slow wave through the mesh, a hundredth of its size: a deformation that a refit is meant for.
std::shared_ptr<const mesh::TriangleMesh> waved(const mesh::TriangleMesh& mesh, double phase) {
  mesh::TriangleMesh moved = mesh;
  const Bounds3f bounds = mesh.bounds();
  const double size = bounds.empty() ? 1.0 : double(max_abs(bounds.extent()));
  for (Vec3f& p : moved.positions) p.y += float(0.01 * size * std::sin(phase + 7.0 * double(p.x) / size));
  ++moved.vertex_version;
  return std::make_shared<const mesh::TriangleMesh>(std::move(moved));
}

/// Refits go back and forth between two poses, always from the tree before.
Timed timed_refit(RefitContender& contender,
                  const std::array<std::shared_ptr<const mesh::TriangleMesh>, 2>& poses) {
  Timed timed;
  timed.run = [&contender, poses, turn = std::size_t(0)]() mutable {
    const auto& pose = poses[turn++ % 2];
    if (contender.theirs) return contender.theirs->refit(pose->positions);
    auto moved = contender.ours->refit(pose);
    if (!moved) return Status(moved.error());
    contender.ours = *std::move(moved);
    return ok_status();
  };
  return timed;
}

Status refits_on(std::size_t threads, const BenchScene& scene, const BenchOptions& options, Report& report,
                 const scene::ProgressCallback& progress) {
  const scene::SceneData data = first_mesh(scene.data);
  const std::array poses{waved(*data.meshes[0], 0.0), waved(*data.meshes[0], 1.0)};
  std::vector<RefitContender> contenders;
  std::vector<Timed> timed;
  contenders.reserve(options.structures.size() + 1);  // tasks point into it
  // Only the scene of low quality keeps a tree a mesh, and so has one to refit; the others build anew.
  auto embree = EmbreeScene::build(data, {.quality = EmbreeQuality::kLow, .use = EmbreeUse::kDynamic});
  if (!embree) return embree.error();
  contenders.push_back({row_of<RefitRow>(scene, threads, "embree", "refit"), {}, *std::move(embree)});
  for (const blas::StructureKind kind : trees_of(options)) {
    auto built = blas::Blas::build(data.meshes[0], {kind}, options.stop);
    if (!built) return built.error();
    if (!built->can_refit()) continue;
    contenders.push_back({row_of<RefitRow>(scene, threads, "gridcast", std::string(blas::to_string(kind))),
                          *std::move(built),
                          {}});
  }
  timed.reserve(contenders.size());
  for (RefitContender& contender : contenders) timed.push_back(timed_refit(contender, poses));
  if (Status status = interleave(timed, threads, clock_for(threads), options, progress); !status)
    return status;
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    fill_speed(contenders[i].row, timed[i].seconds);
    contenders[i].row.vs_embree_refit = speedup(timed[i].seconds, timed[0].seconds);
    report.refit.push_back(contenders[i].row);
  }
  return ok_status();
}

}  // namespace

Status bench_builds(const BenchScene& bench_scene, const BenchOptions& options, Report& report,
                    const scene::ProgressCallback& progress) {
  for (const std::size_t threads : options.threads)
    if (Status status = builds_on(threads, bench_scene, options, report, progress); !status) return status;
  return ok_status();
}

Status bench_refits(const BenchScene& bench_scene, const BenchOptions& options, Report& report,
                    const scene::ProgressCallback& progress) {
  for (const std::size_t threads : options.threads)
    if (Status status = refits_on(threads, bench_scene, options, report, progress); !status) return status;
  return ok_status();
}

}  // namespace gridcast::measure
