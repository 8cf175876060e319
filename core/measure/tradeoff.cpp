#include "core/measure/tradeoff.h"

#include <algorithm>
#include <memory>
#include <utility>

#include <oneapi/tbb/task_arena.h>

#include "core/measure/embree_yardstick.h"
#include "core/measure/interleave.h"
#include "core/measure/pareto.h"
#include "core/measure/scene_reference.h"
#include "core/measure/statistics.h"
#include "core/measure/tradeoff_method.h"
#include "core/scene/flatten.h"
#include "core/scene/trace.h"

namespace gridcast::measure {
namespace {

constexpr std::size_t kPicturePixels = std::size_t(128) * 128;
/// Shares of a class in the progress: exact answers, timings; the rest is comparing.
constexpr double kTruthShare = 0.2, kSpeedShare = 0.6;
/// Share of building in the whole.
constexpr double kBuildShare = 0.1;

Error cancelled() {
  return {ErrorCode::kCancelled, "the measurement was stopped", ""};
}

double per_triangle(std::size_t bytes, std::uint64_t triangles) {
  return triangles > 0 ? double(bytes) / double(triangles) : 0.0;
}

std::size_t tree_bytes(const scene::Scene& scene) {
  std::size_t bytes = scene.top_level().memory_bytes();
  for (std::uint32_t id = 0; id < scene.mesh_count(); ++id) bytes += scene.blas(id).stats().memory_bytes;
  return bytes;
}

/// Calls `work(progress of its part)`, which goes from `begin` to `end` of the whole.
scene::ProgressCallback part(const scene::ProgressCallback& whole, double begin, double end) {
  if (!whole) return {};
  return [&whole, begin, end](double fraction) { whole(begin + fraction * (end - begin)); };
}

class Measurement {
 public:
  Measurement(const TradeoffOptions& options, const scene::ProgressCallback& progress)
      : options_(options), progress_(progress) {
    report_.options = options;
  }

  Result<TradeoffReport> run(const scene::SceneData& data) {
    if (Status status = pose(data); !status) return status.error();
    if (Status status = build_ours(); !status) return status.error();
    if (Status status = build_embree(); !status) return status.error();
    const auto reference = reference_of(data_, options_.stop);
    if (!reference) return reference.error();
    const View view = options_.view ? *options_.view : framed_scene({}, {}, posed_->bounds()).view;
    const RayClassMaker maker(*posed_, view, options_.seed);
    const auto pictures = compare_pictures(*reference, view);
    if (!pictures) return pictures.error();
    for (std::size_t i = 0; i < options_.classes.size(); ++i) {
      const double step = (1.0 - kBuildShare) / double(options_.classes.size());
      const double begin = kBuildShare + double(i) * step;
      if (Status status = measure_class(options_.classes[i], *reference, maker, *pictures,
                                        part(progress_, begin, begin + step));
          !status)
        return status.error();
    }
    return std::move(report_);
  }

 private:
  /// The scene as it stands, as plain data: what all structures, Embree and the reference are built from.
  Status pose(const scene::SceneData& data) {
    auto posed = scene::build_scene(data, {{}, options_.stop, {}});
    if (!posed) return posed.error();
    posed_ = *std::move(posed);
    if (posed_->bounds().empty())
      return Error{ErrorCode::kInvalidArgument, "the scene has no triangle that a ray could hit", ""};
    data_ = scene::flattened(*posed_);
    report_.stored_triangles = posed_->stored_triangle_count();
    // An instance that was removed has kept its number only.
    for (std::uint32_t id = 0; id < posed_->instance_slots(); ++id) {
      const auto instance = posed_->find_instance(id);
      if (!instance || !instance->transform.active()) continue;
      ++report_.instances;
      report_.world_triangles += posed_->blas(instance->mesh_id).mesh().triangle_count();
    }
    report_.meshes = posed_->mesh_count();
    for (std::uint32_t id = 0; id < posed_->mesh_count(); ++id)
      report_.closed_meshes += posed_->blas(id).has_inside() ? 1 : 0;
    report_.diagonal = glm::length(posed_->bounds().extent());
    return ok_status();
  }

  /// Runs `work()` on the threads that are timed; the seconds that it took.
  template <class Work>
  double timed(const Work& work) const {
    oneapi::tbb::task_arena arena(int(options_.threads), 1);
    return seconds(clock_for(options_.threads), [&] { arena.execute(work); });
  }

  [[nodiscard]] std::vector<blas::StructureKind> wanted_structures() {
    using blas::StructureKind;
    std::vector<StructureKind> kinds = options_.structures;
    if (kinds.empty())
      kinds = {StructureKind::kWideBvh, StructureKind::kCompactBvh, StructureKind::kBvh,
               StructureKind::kKdTree,  StructureKind::kEmbree,     StructureKind::kBruteForce};
    if (report_.world_triangles > kMaxBruteForceTriangles &&
        std::erase(kinds, StructureKind::kBruteForce) > 0)
      report_.notes.emplace_back("Brute force is left out: the scene has more than 2,000 triangles.");
    return kinds;
  }

  Status build_ours() {
    for (const blas::StructureKind kind : wanted_structures()) {
      Result<std::shared_ptr<const scene::Scene>> built = cancelled();
      const double taken = timed([&] { built = scene::build_scene(data_, {{kind}, options_.stop, {}}); });
      if (!built && built.error().code == ErrorCode::kUnsupported) {
        report_.notes.push_back(std::string(blas::to_string(kind)) +
                                " is left out: " + built.error().message);
        continue;
      }
      if (!built) return built.error();
      ours_.push_back(*std::move(built));
      for (const Precision precision : options_.precisions) {
        auto method = make_our_method(*ours_.back(), precision);
        method->structure = blas::to_string(kind);
        method->bytes_per_triangle = per_triangle(tree_bytes(*ours_.back()), report_.stored_triangles);
        method->build_s = taken;
        methods_.push_back(std::move(method));
      }
      if (progress_) progress_(kBuildShare * double(ours_.size()) / 8.0);
    }
    if (methods_.empty())
      return Error{ErrorCode::kInvalidArgument, "no structure is left to measure on this scene",
                   "/structures"};
    return ok_status();
  }

  Status build_embree() {
    for (const EmbreeMode mode : {EmbreeMode::kDefault, EmbreeMode::kRobust}) {
      if (options_.stop.stop_requested()) return cancelled();
      Result<std::unique_ptr<EmbreeScene>> built = cancelled();
      const double taken = timed([&] { built = EmbreeScene::build(data_, {.mode = mode}, options_.stop); });
      if (!built) return built.error();
      embree_.push_back(*std::move(built));
      for (const EmbreeEntry entry :
           {EmbreeEntry::kSingle, EmbreeEntry::kPacket16, EmbreeEntry::kPacket16Coherent}) {
        auto method = make_embree_method(*embree_.back(), mode, entry);
        method->bytes_per_triangle = per_triangle(embree_.back()->memory_bytes(), report_.stored_triangles);
        method->build_s = taken;
        methods_.push_back(std::move(method));
      }
    }
    return ok_status();
  }

  /// Of every method, how many pixels show another triangle than they should.
  Result<std::vector<Rate>> compare_pictures(const exact::Reference& reference, const View& view) {
    const RaySetMaker maker(*posed_, view, kPicturePixels, options_.seed);
    const auto rays = maker.make(RaySetKind::kPrimary);
    if (!rays) return rays.error();
    const auto truth = Truth::find(reference, *rays, {}, report_.diagonal, options_.stop, {});
    if (!truth) return truth.error();
    std::vector<Rate> pictures;
    for (const auto& method : methods_) {
      const auto reported = method->answer(*rays, options_.stop);
      if (!reported) return reported.error();
      pictures.push_back(truth->other_primitive(*reported));
    }
    if (progress_) progress_(kBuildShare);
    return pictures;
  }

  /// Packets that are told to be coherent are for rays that are. Coherent any-hit packets through instances
  /// do not return from Embree 3.13.5.
  [[nodiscard]] bool takes_part(const TradeoffMethod& method, RaySetKind kind) const {
    if (method.entry != to_string(EmbreeEntry::kPacket16Coherent)) return true;
    return is_coherent(kind) && (query_of(kind) == QueryKind::kClosest || is_single_mesh(data_));
  }

  Status measure_class(RayClass ray_class, const exact::Reference& reference, const RayClassMaker& maker,
                       const std::vector<Rate>& pictures, const scene::ProgressCallback& progress) {
    const auto timed_rays = maker.make(ray_class, options_.speed_rays);
    const auto rays = maker.make(ray_class, options_.accuracy_rays);
    if (!timed_rays || !rays) {
      report_.notes.push_back("The class " + std::string(to_string(ray_class)) +
                              " is left out: " + (timed_rays ? rays : timed_rays).error().message + ".");
      return ok_status();
    }
    auto inside = maker.starts_inside(*rays, options_.stop);
    if (!inside) return inside.error();
    const auto truth = Truth::find(reference, *rays, *std::move(inside), report_.diagonal, options_.stop,
                                   part(progress, 0.0, kTruthShare));
    if (!truth) return truth.error();
    const std::size_t first = report_.rows.size();
    auto rows = time_methods(ray_class, *timed_rays, part(progress, kTruthShare, kTruthShare + kSpeedShare));
    if (!rows) return rows.error();
    for (std::size_t i = 0; i < rows->size(); ++i) {
      Candidate& candidate = (*rows)[i];
      const auto reported = methods_[candidate.method]->answer(*rays, options_.stop);
      if (!reported) return reported.error();
      candidate.row.accuracy = truth->judge(*reported);
      candidate.row.image_difference = pictures[candidate.method];
      report_.rows.push_back(std::move(candidate.row));
      if (progress)
        progress(kTruthShare + kSpeedShare +
                 (1.0 - kTruthShare - kSpeedShare) * double(i + 1) / double(rows->size()));
    }
    mark_front(first);
    return ok_status();
  }

  struct Candidate {
    std::size_t method = 0;
    TradeoffRow row;
  };

  /// A row for every method of ours, and for Embree's modes the fastest way to ask.
  Result<std::vector<Candidate>> time_methods(RayClass ray_class, const RaySet& rays,
                                              const scene::ProgressCallback& progress) {
    std::vector<Timed> contenders;
    std::vector<std::size_t> of_method;
    for (std::size_t i = 0; i < methods_.size(); ++i) {
      TradeoffMethod& method = *methods_[i];
      if (!takes_part(method, rays.kind)) continue;
      of_method.push_back(i);
      contenders.push_back({[&method, &rays, this] { return method.trace(rays, options_.stop); },
                            // Not with the caches full of another's tree.
                            [&method, &rays, this] {
                              method.prepare(rays);
                              (void)method.trace(rays, options_.stop);
                            },
                            {},
                            {}});
    }
    BenchOptions interleaved;
    interleaved.repeat = options_.repeat;
    interleaved.stop = options_.stop;
    if (Status status =
            interleave(contenders, options_.threads, clock_for(options_.threads), interleaved, progress);
        !status)
      return status.error();
    std::vector<Candidate> rows;
    for (std::size_t k = 0; k < contenders.size(); ++k) {
      Candidate made{of_method[k], row_of(ray_class, *methods_[of_method[k]], rays, contenders[k].seconds)};
      const auto same = std::ranges::find_if(rows, [&](const Candidate& other) {
        return other.row.engine == made.row.engine && other.row.structure == made.row.structure &&
               other.row.precision == made.row.precision;
      });
      if (same == rows.end())
        rows.push_back(std::move(made));
      else if (made.row.mrays_per_s > same->row.mrays_per_s)
        *same = std::move(made);
    }
    return rows;
  }

  static TradeoffRow row_of(RayClass ray_class, const TradeoffMethod& method, const RaySet& rays,
                            const Samples& seconds) {
    TradeoffRow row;
    row.engine = method.engine;
    row.structure = method.structure;
    row.precision = method.precision;
    row.ray_class = ray_class;
    row.entry = method.entry;
    row.timed_rays = rays.size();
    const double middle = median(seconds);
    row.mrays_per_s = middle > 0.0 ? double(rays.size()) / middle / 1e6 : 0.0;
    row.spread = spread(seconds);
    row.bytes_per_triangle = method.bytes_per_triangle;
    row.build_s = method.build_s;
    return row;
  }

  /// Of the rows of one class, which begin at `first`.
  void mark_front(std::size_t first) {
    std::vector<TradeoffPoint> points;
    for (std::size_t i = first; i < report_.rows.size(); ++i)
      points.push_back({report_.rows[i].mrays_per_s, report_.rows[i].accuracy.errors().per_million()});
    const std::vector<bool> front = pareto_front(points);
    for (std::size_t i = 0; i < front.size(); ++i) report_.rows[first + i].on_front = front[i];
  }

  const TradeoffOptions& options_;
  const scene::ProgressCallback& progress_;
  TradeoffReport report_;
  std::shared_ptr<const scene::Scene> posed_;
  scene::SceneData data_;
  std::vector<std::shared_ptr<const scene::Scene>> ours_;
  std::vector<std::unique_ptr<EmbreeScene>> embree_;
  std::vector<std::unique_ptr<TradeoffMethod>> methods_;
};

}  // namespace

Result<TradeoffReport> measure_tradeoffs(const scene::SceneData& data, const TradeoffOptions& options,
                                         const scene::ProgressCallback& progress) {
  return Measurement(options, progress).run(data);
}

}  // namespace gridcast::measure
