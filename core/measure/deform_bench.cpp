// The section `deform`: how well a scene's tree follows its vertices.

#include <algorithm>
#include <memory>
#include <utility>
#include <variant>

#include <oneapi/tbb/task_arena.h>

#include "core/measure/answers.h"
#include "core/measure/bench.h"
#include "core/measure/deform_summary.h"
#include "core/measure/deformation_set.h"
#include "core/measure/embree_yardstick.h"
#include "core/measure/interleave.h"
#include "core/measure/random.h"
#include "core/scene/tree_replacement.h"
#include "core/scene/update.h"

namespace gridcast::measure {
namespace {

using ScenePtr = std::shared_ptr<const scene::Scene>;

/// A tree that no longer fits takes milliseconds a ray: more rays would add hours and no digits.
constexpr std::size_t kMostRays = 10'000;
/// Embree's tree that is only refitted may be hundreds of times slower: it gets one ray in so many.
constexpr std::size_t kRefittedStride = 4;

constexpr std::size_t kThreads = 1;
constexpr ClockKind kClock = clock_for(kThreads);

template <class Work>
double ms_of(const Work& work) {
  oneapi::tbb::task_arena arena(int(kThreads), 1);
  return 1000.0 * seconds(kClock, [&] { arena.execute(work); });
}

/// From around the mesh to points on its triangles, any triangle equally likely.
void add_aimed_rays(const mesh::TriangleMesh& mesh, const Bounds3d& bounds, std::size_t count,
                    std::uint64_t seed, RaySet& set) {
  Random random(seed + 800);
  const double radius = glm::length(bounds.extent());
  for (std::size_t i = 0; i < count; ++i) {
    const auto corners = mesh.corners(random.below(std::uint32_t(mesh.triangle_count())));
    double u = random.uniform(), v = random.uniform();
    if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
    const Vec3d target = (1.0 - u - v) * Vec3d(corners[0]) + u * Vec3d(corners[1]) + v * Vec3d(corners[2]);
    const Vec3f origin(bounds.center() + radius * random.direction());
    const Vec3f to(target - Vec3d(origin));
    set.rows.push_back({origin.x, origin.y, origin.z, 0.F, to.x, to.y, to.z, 1e30F});
  }
}

/// Half from a camera that sees all of the mesh, half aimed at its triangles.
Result<RaySet> rays_at(const scene::Scene& scene, const BenchOptions& options) {
  const std::size_t count = std::min(options.rays, kMostRays);
  const View view = framed_scene({}, {}, scene.bounds()).view;
  auto set = RaySetMaker(scene, view, (count + 1) / 2, options.seed).make(RaySetKind::kPrimary);
  if (set) add_aimed_rays(scene.blas(0).mesh(), scene.bounds(), count - set->size(), options.seed, *set);
  return set;
}

RaySet every_nth(const RaySet& rays, std::size_t stride) {
  RaySet some{rays.kind, {}};
  for (std::size_t i = 0; i < rays.size(); i += stride) some.rows.push_back(rays.rows[i]);
  return some;
}

/// What an update leaves for queries to work on, and what it did.
struct Maintained {
  ScenePtr scene;
  scene::MeshAction action;
};

/// Brings the vertices to `positions` as a server would.
Result<Maintained> maintain(const scene::Scene& before, std::vector<Vec3f> positions) {
  auto updated = scene::apply_update(
      before, {scene::ReplaceVertices{0, std::move(positions), {}, scene::UpdateMode::kAuto}},
      {.rebuilds = scene::RebuildPlace::kInBackground});
  if (!updated) return updated.error();
  return Maintained{updated->scene, updated->report.meshes[0].action};
}

/// What a server's builder of trees does between two frames: puts in the better tree that an update ordered.
Status catch_up(ScenePtr& maintained, const std::stop_token& stop) {
  const auto order = scene::better_tree(*maintained, 0);
  if (!order) return ok_status();
  const auto built = blas::Blas::build(order->mesh, order->options, stop);
  if (!built) return built.error();
  auto swapped = scene::replace_tree(*maintained, 0, *built);
  if (!swapped) return swapped.error();
  if (auto* next = std::get_if<ScenePtr>(&*swapped)) maintained = std::move(*next);
  return ok_status();
}

/// One deformation, from trees that were built for its first moment.
class DeformationRun {
 public:
  DeformationRun(const BenchScene& from, Deformation deformation, const BenchOptions& options)
      : deformation_(deformation), options_(options), rest_(first_mesh(from.data)) {
    check_.scene = from.name;
    check_.set = to_string(deformation);
    check_.precision = "robust";
    check_.entry = "single";
    check_.threads = kThreads;
  }

  Status start() {
    const scene::SceneData first = at(vertices(0.0));
    auto built = scene::build_scene(first, {{}, options_.stop, {}});
    if (!built) return built.error();
    maintained_ = *std::move(built);
    check_.structure = blas::to_string(maintained_->blas(0).stats().kind);
    auto theirs = EmbreeScene::build(first, {.quality = EmbreeQuality::kLow, .use = EmbreeUse::kDynamic},
                                     options_.stop);
    if (!theirs) return theirs.error();
    refitted_ = *std::move(theirs);
    return refitted_->refit(first.meshes[0]->positions);  // the first builds what can be refitted
  }

  /// Frames from 1 to options.frames, in this order.
  Result<DeformRow> frame(std::size_t frame) {
    DeformRow row;
    row.scene = check_.scene;
    row.deformation = check_.set;
    row.frame = frame;
    const std::vector<Vec3f> positions = vertices(double(frame) / double(options_.frames));
    if (Status status = update(positions, row); !status) return status.error();
    if (Status status = query(positions, row); !status) return status.error();
    if (Status status = catch_up(maintained_, options_.stop); !status) return status.error();
    return row;
  }

  [[nodiscard]] const CheckRow& check() const { return check_; }

 private:
  [[nodiscard]] std::vector<Vec3f> vertices(double phase) const {
    return deformed(deformation_, rest_.meshes[0]->positions, phase, options_.seed);
  }

  [[nodiscard]] scene::SceneData at(std::vector<Vec3f> positions) const {
    scene::SceneData data = rest_;
    mesh::TriangleMesh moved = *rest_.meshes[0];
    moved.positions = std::move(positions);
    moved.normals.clear();
    data.meshes[0] = std::make_shared<const mesh::TriangleMesh>(std::move(moved));
    return data;
  }

  Status update(const std::vector<Vec3f>& positions, DeformRow& row) {
    Status status = ok_status();
    ScenePtr before;  // let go of after the clock has stopped
    std::vector<Vec3f> handed_over = positions;
    row.update_ms = ms_of([&] {
      auto after = maintain(*maintained_, std::move(handed_over));
      if (!after) return void(status = after.error());
      before = std::exchange(maintained_, after->scene);
      row.action = scene::to_string(after->action);
    });
    if (!status) return status;
    row.embree_update_ms = ms_of([&] { status = refitted_->refit(positions); });
    return status;
  }

  Status query(std::vector<Vec3f> positions, DeformRow& row) {
    const scene::SceneData data = at(std::move(positions));
    const auto fresh = scene::build_scene(data, {{}, options_.stop, {}});
    if (!fresh) return fresh.error();
    std::unique_ptr<EmbreeScene> rebuilt;
    Status status = ok_status();
    row.embree_build_ms = ms_of([&] {
      auto built = EmbreeScene::build(data, {}, options_.stop);
      if (!built) return void(status = built.error());
      rebuilt = *std::move(built);
    });
    if (!status) return status;
    const double cost = (*fresh)->blas(0).stats().cost;
    row.cost_ratio = cost > 0.0 ? maintained_->blas(0).stats().cost / cost : 1.0;
    const auto rays = rays_at(**fresh, options_);
    if (!rays) return rays.error();
    return race(**fresh, *rebuilt, *rays, row);
  }

  Status race(const scene::Scene& fresh, const EmbreeScene& rebuilt, const RaySet& rays, DeformRow& row) {
    const RaySet few = every_nth(rays, kRefittedStride);
    Answers ours, expected;
    EmbreeAnswers theirs(rays.size());
    std::vector<Timed> timed(4);
    timed[0] = asked(*maintained_, rays, ours);
    timed[1] = asked(fresh, rays, expected);
    timed[2] = asked(*refitted_, few, theirs);
    timed[3] = asked(rebuilt, few, theirs);
    timed[1].after = [&] { compare(ours, expected); };
    if (Status status = interleave(timed, kThreads, kClock, options_, {}); !status) return status;
    row.vs_fresh = speedup(timed[1].seconds, timed[0].seconds);
    row.embree_refit_vs_fresh = speedup(timed[3].seconds, timed[2].seconds);
    row.fresh_ns_per_ray = 1e9 * median(timed[1].seconds) / double(rays.size());
    Samples ratios;
    for (std::size_t i = 0; i < timed[0].seconds.size(); ++i)
      ratios.push_back(timed[0].seconds[i] / timed[1].seconds[i]);
    row.spread = spread(std::move(ratios));
    return ok_status();
  }

  static Timed asked(const scene::Scene& scene, const RaySet& rays, Answers& answers) {
    answers.resize(rays.size(), QueryKind::kClosest);
    Timed timed;
    timed.run = [&] {
      trace_single(scene, rays, Precision::kRobust, 0, rays.size(), answers);
      return ok_status();
    };
    return timed;
  }

  static Timed asked(const EmbreeScene& scene, const RaySet& rays, EmbreeAnswers& answers) {
    Timed timed;
    timed.run = [&] {
      scene.trace(rays.rows, 0, rays.size(), QueryKind::kClosest, EmbreeEntry::kSingle, answers);
      return ok_status();
    };
    return timed;
  }

  void compare(const Answers& ours, const Answers& expected) {
    check_.rays += expected.status().size();
    check_.hits += count_hits(expected);
    check_.differs += count_differences(ours, expected);
  }

  Deformation deformation_;
  const BenchOptions& options_;
  scene::SceneData rest_;
  ScenePtr maintained_;
  std::unique_ptr<EmbreeScene> refitted_;
  CheckRow check_;
};

}  // namespace

Status bench_deformations(const BenchScene& bench_scene, const BenchOptions& options, Report& report,
                          const scene::ProgressCallback& progress) {
  const double steps = double(kAllDeformations.size() * options.frames);
  double done = 0.0;
  std::vector<DeformSummaryRow> summaries;
  for (const Deformation deformation : kAllDeformations) {
    DeformationRun run(bench_scene, deformation, options);
    if (Status status = run.start(); !status) return status;
    std::vector<DeformRow> rows;
    for (std::size_t frame = 1; frame <= options.frames; ++frame) {
      auto row = run.frame(frame);
      if (!row) return row.error();
      rows.push_back(*std::move(row));
      done += 1.0;
      if (progress) progress(done / steps);
    }
    summaries.push_back(summary_of(rows, bench_scene.data.meshes[0]->triangle_count()));
    report.deform.insert(report.deform.end(), rows.begin(), rows.end());
    report.checks.push_back(run.check());
  }
  report.deform_summary.insert(report.deform_summary.end(), summaries.begin(), summaries.end());
  report.deform_summary.push_back(worst_of(summaries));
  return ok_status();
}

}  // namespace gridcast::measure
