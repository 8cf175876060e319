// The section `rays`: how many rays a second, ours and Embree's, one after the other in every repetition.

#include <functional>
#include <map>
#include <memory>
#include <utility>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include "core/math/precision_names.h"
#include "core/measure/answers.h"
#include "core/measure/bench.h"
#include "core/measure/embree_yardstick.h"
#include "core/measure/statistics.h"
#include "core/scene/trace.h"

namespace gridcast::measure {
namespace {

namespace tbb = oneapi::tbb;

/// Rays per task of the loops over single rays and packets; the stop token is looked at between tasks.
constexpr std::size_t kRaysPerTask = 4096;
/// Triangle tests that the comparison with brute force may take for a ray set and precision.
constexpr double kBruteForceTests = 2e7;
constexpr std::size_t kMaxBruteForceRays = 256;
/// Brute force is a contender on scenes of at most this many triangles.
constexpr std::uint64_t kMaxBruteForceTriangles = 2000;

Error cancelled() {
  return {ErrorCode::kCancelled, "the benchmark was stopped", ""};
}

/// Runs `work(begin, end)` over all rays on the calling arena.
template <class Work>
void for_pieces(std::size_t count, const std::stop_token& stop, const Work& work) {
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, kRaysPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        if (!stop.stop_requested()) work(range.begin(), range.end());
      },
      tbb::simple_partitioner());
}

struct OurScene {
  blas::StructureKind structure;
  std::shared_ptr<const scene::Scene> scene;
};
struct TheirScene {
  EmbreeOptions options;
  std::unique_ptr<EmbreeScene> scene;
};

/// The share of its rays that a contender traces before it is timed, so that it does not find the caches full
/// of the tree of the one before.
constexpr std::size_t kLeadInPart = 8;

/// One row of the table: how its answers are made, and what they took.
struct Contender {
  RayRow row;
  std::function<void()> lead_in;  ///< before every run, not timed
  std::function<void()> run;      ///< timed
  std::function<void()> check;    ///< after every run, not timed
  Samples seconds;
  CheckRow found;
};

class RaysOfScene {
 public:
  RaysOfScene(const BenchScene& from, const BenchOptions& options, Report& report,
              const scene::ProgressCallback& progress)
      : from_(from), options_(options), report_(report), progress_(progress) {}

  Status run() {
    if (Status status = build(); !status) return status;
    const RaySetMaker maker(*ours_[0].scene, from_.view, options_.rays, options_.seed);
    for (const RaySetKind kind : options_.sets) {
      const auto rays = maker.make(kind);
      if (!rays) return rays.error();
      for (const std::size_t threads : options_.threads) {
        if (Status status = run_set(*rays, threads); !status) return status;
      }
      ++sets_done_;
    }
    return ok_status();
  }

 private:
  Status build() {
    std::vector<blas::StructureKind> kinds = options_.structures;
    if (kinds.empty()) kinds.push_back(blas::StructureKind::kAuto);
    for (const blas::StructureKind kind : kinds) {
      auto scene = build_with(kind);
      if (!scene) return scene.error();
      if (kind == blas::StructureKind::kBruteForce &&
          (*scene)->world_triangle_count() > kMaxBruteForceTriangles)
        continue;
      ours_.push_back({kind, *std::move(scene)});
    }
    auto brute_force = build_with(blas::StructureKind::kBruteForce);
    if (!brute_force) return brute_force.error();
    brute_force_ = *std::move(brute_force);
    if (ours_.empty())
      return Error{ErrorCode::kInvalidArgument, "the scene is too large for brute force", ""};
    return build_embree();
  }

  Result<std::shared_ptr<const scene::Scene>> build_with(blas::StructureKind kind) const {
    return scene::build_scene(from_.data, {{kind}, options_.stop, {}});
  }

  Status build_embree() {
    for (const EmbreeOptions& options :
         {EmbreeOptions{.mode = EmbreeMode::kDefault}, EmbreeOptions{.mode = EmbreeMode::kRobust},
          EmbreeOptions{.quality = EmbreeQuality::kHigh}}) {
      if (options_.stop.stop_requested()) return cancelled();
      auto scene = EmbreeScene::build(from_.data, options);
      if (!scene) return scene.error();
      embree_.push_back({options, *std::move(scene)});
    }
    return ok_status();
  }

  Status run_set(const RaySet& rays, std::size_t threads) {
    tbb::task_arena arena(int(threads), 1);
    contenders_.clear();
    references_.clear();
    embree_answers_ = std::make_unique<EmbreeAnswers>(rays.size());
    add_embree(rays, threads);
    add_ours(rays, threads);
    for (std::size_t round = 0; round <= options_.repeat; ++round) {
      for (std::size_t i = 0; i < contenders_.size(); ++i) {
        Contender& contender = contenders_[i];
        scratch_ = {};
        scratch_.resize(rays.size(), query_of(rays.kind));
        arena.execute(contender.lead_in);
        const double taken = seconds(clock_for(threads), [&] { arena.execute(contender.run); });
        if (options_.stop.stop_requested()) return cancelled();
        // The first round warms up, and gives the answers that the others are compared with.
        if (round > 0) contender.seconds.push_back(taken);
        contender.check();
        show_progress(double(round) + double(i + 1) / double(contenders_.size()));
      }
    }
    finish(rays);
    return ok_status();
  }

  void show_progress(double rounds) const {
    if (!progress_) return;
    const double in_set = rounds / double(options_.repeat + 1);
    progress_((double(sets_done_) + in_set) / double(options_.sets.size()));
  }

  RayRow row(const RaySet& rays, std::size_t threads) const {
    RayRow row;
    row.scene = from_.name;
    row.set = to_string(rays.kind);
    row.threads = threads;
    return row;
  }

  /// Coherent any-hit packets through instances do not return from Embree 3.13.5.
  [[nodiscard]] bool can_be_coherent(RaySetKind kind) const {
    return is_coherent(kind) && (query_of(kind) == QueryKind::kClosest || is_single_mesh(from_.data));
  }

  void add_embree(const RaySet& rays, std::size_t threads) {
    for (const TheirScene& their : embree_) {
      std::vector<EmbreeEntry> entries{EmbreeEntry::kSingle, EmbreeEntry::kPacket8, EmbreeEntry::kPacket16};
      if (can_be_coherent(rays.kind)) entries.push_back(EmbreeEntry::kPacket16Coherent);
      if (their.options.mode == EmbreeMode::kRobust) entries = {EmbreeEntry::kSingle};
      for (const EmbreeEntry entry : entries) {
        Contender& added = contenders_.emplace_back();
        added.row = row(rays, threads);
        added.row.engine = "embree";
        added.row.structure = to_string(their.options.quality);
        added.row.precision = to_string(their.options.mode);
        added.row.entry = to_string(entry);
        const EmbreeScene* scene = their.scene.get();
        added.lead_in = [this, scene, entry, &rays] {
          scene->trace(rays.rows, 0, rays.size() / kLeadInPart, query_of(rays.kind), entry, *embree_answers_);
        };
        added.run = [this, scene, entry, &rays] {
          for_pieces(rays.size(), options_.stop, [&](std::size_t begin, std::size_t end) {
            scene->trace(rays.rows, begin, end, query_of(rays.kind), entry, *embree_answers_);
          });
        };
        const bool is_robust = their.options.mode == EmbreeMode::kRobust;
        added.check = [this, is_robust] {
          if (is_robust && !robust_answers_) robust_answers_ = *embree_answers_;
        };
      }
    }
    robust_answers_.reset();
  }

  void add_ours(const RaySet& rays, std::size_t threads) {
    for (const Precision precision : options_.precisions) {
      for (const OurScene& our : ours_) {
        for (const bool batch : {false, true}) {
          RayRow added = row(rays, threads);
          added.engine = "gridcast";
          added.structure = blas::to_string(our.structure);
          added.precision = to_string(precision);
          added.entry = batch ? "batch" : "single";
          add_our(rays, std::move(added), *our.scene, precision);
        }
      }
    }
  }

  void add_our(const RaySet& rays, RayRow row, const scene::Scene& scene, Precision precision) {
    const std::size_t at = contenders_.size();
    Contender& added = contenders_.emplace_back();
    added.found = {row.scene, row.set, row.structure, row.precision, row.entry, row.threads};
    added.lead_in = [&rays, &scene, precision] {
      Answers unused;
      unused.resize(rays.size() / kLeadInPart, query_of(rays.kind));
      trace_single(scene, rays, precision, 0, rays.size() / kLeadInPart, unused);
    };
    if (row.entry == "batch") {
      added.run = [this, &rays, &scene, precision] { trace_batch(scene, rays, precision); };
    } else {
      added.run = [this, &rays, &scene, precision] {
        for_pieces(rays.size(), options_.stop, [&](std::size_t begin, std::size_t end) {
          trace_single(scene, rays, precision, begin, end, scratch_);
        });
      };
    }
    added.check = [this, at, &rays, precision] { check(contenders_[at], rays, precision); };
    added.row = std::move(row);
  }

  void trace_batch(const scene::Scene& scene, const RaySet& rays, Precision precision) {
    const scene::TraceOptions options{precision, HitField::kAll, options_.stop, {}};
    // Into memory that is there already, as Embree's answers go: what is stopped is not looked at.
    if (query_of(rays.kind) == QueryKind::kAny) {
      (void)scene::occluded_into(scene, rays.batch(), options, scratch_.occluded);
    } else {
      (void)scene::intersect_into(scene, rays.batch(), options, scratch_.hits, 0);
    }
  }

  /// Every answer of every run is compared with those of the first contender of its precision.
  void check(Contender& contender, const RaySet& rays, Precision precision) {
    const auto [reference, is_new] = references_.try_emplace(precision);
    if (is_new) reference->second = scratch_;
    CheckRow& found = contender.found;
    found.differs += count_differences(scratch_, reference->second);
    if (found.rays > 0) return;
    found.rays = rays.size();
    found.hits = count_hits(scratch_);
    found.embree_differs = robust_answers_ ? count_differences(scratch_, *robust_answers_) : 0;
    const double triangles = double(std::max<std::uint64_t>(1, brute_force_->stored_triangle_count()));
    const auto sample = std::size_t(std::max(2.0, kBruteForceTests / triangles));
    const SampleCheck exact =
        check_sample(*brute_force_, rays, precision, std::min(sample, kMaxBruteForceRays), scratch_);
    found.brute_force_rays = exact.rays;
    found.brute_force_differs = exact.differs;
  }

  void finish(const RaySet& rays) {
    const auto samples_of = [&](std::string_view mode) {
      for (const Contender& c : contenders_)
        if (c.row.engine == "embree" && c.row.structure == "medium" && c.row.precision == mode &&
            c.row.entry == "single")
          return c.seconds;
      return Samples{};
    };
    const Samples default_s = samples_of("default"), robust_s = samples_of("robust");
    for (Contender& contender : contenders_) {
      const double middle = median(contender.seconds);
      contender.row.mrays_per_s = middle > 0.0 ? double(rays.size()) / middle / 1e6 : 0.0;
      contender.row.spread = spread(contender.seconds);
      contender.row.vs_embree_default = speedup(contender.seconds, default_s);
      contender.row.vs_embree_robust = speedup(contender.seconds, robust_s);
      report_.rays.push_back(contender.row);
      if (contender.row.engine == "gridcast") report_.checks.push_back(contender.found);
    }
  }

  const BenchScene& from_;
  const BenchOptions& options_;
  Report& report_;
  const scene::ProgressCallback& progress_;
  std::vector<OurScene> ours_;
  std::vector<TheirScene> embree_;
  std::shared_ptr<const scene::Scene> brute_force_;
  std::vector<Contender> contenders_;
  std::map<Precision, Answers> references_;
  std::optional<EmbreeAnswers> robust_answers_;
  std::unique_ptr<EmbreeAnswers> embree_answers_;
  Answers scratch_;
  std::size_t sets_done_ = 0;
};

}  // namespace

Status bench_rays(const BenchScene& bench_scene, const BenchOptions& options, Report& report,
                  const scene::ProgressCallback& progress) {
  return RaysOfScene(bench_scene, options, report, progress).run();
}

}  // namespace gridcast::measure
