#include "server/bench/crowd.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "core/measure/crowd.h"
#include "core/measure/statistics.h"
#include "server/bench/loopback.h"
#include "server/thread_limit.h"

namespace gridcast::server {
namespace {

using measure::ClockKind;
using measure::now_s;

constexpr std::size_t kClients = 2;
/// Of a batch: an answer comes some hundred times a phase, so that its ends cut off little.
constexpr std::size_t kMostRays = 16'384;
/// Updates that are timed while nobody casts: one loop of the animation.
constexpr std::size_t kLoneUpdates = std::size_t(measure::kCrowdLoopSeconds * kCrowdUpdatesPerSecond);

/// The first error of any thread.
class FirstError {
 public:
  void keep(const Status& status) {
    if (status) return;
    const std::lock_guard lock(mutex_);
    if (first_.ok()) first_ = status;
    failed_ = true;
  }
  [[nodiscard]] bool failed() const { return failed_; }
  [[nodiscard]] Status status() const {
    const std::lock_guard lock(mutex_);
    return first_;
  }

 private:
  mutable std::mutex mutex_;
  Status first_ = ok_status();
  std::atomic<bool> failed_ = false;
};

/// The clock that phases and updates go by. kProcess: the CPU time of the process over the number of its
/// cores. It is that of the wall when the process has its cores for itself, and when others take of them it
/// goes slower, so that an update comes after as much work as it would then.
class Pace {
 public:
  Pace(ClockKind clock, std::size_t cores)
      : clock_(clock), cores_(clock == ClockKind::kProcess ? double(cores) : 1.0) {}

  [[nodiscard]] double now() const { return now_s(clock_) / cores_; }

  void wait_until(double due, const std::function<bool()>& go_on) const {
    constexpr double kLeastSeconds = 1e-4, kMostSeconds = 0.05;
    for (double left = due - now(); left > 0.0 && go_on(); left = due - now())
      std::this_thread::sleep_for(
          std::chrono::duration<double>(std::clamp(left, kLeastSeconds, kMostSeconds)));
  }

 private:
  ClockKind clock_;
  double cores_;
};

/// Casts one batch again and again, from construction to destruction.
class Caster {
 public:
  Caster(int port, const measure::RaySet& rays, FirstError& error)
      : thread_([this, port, &rays, &error](const std::stop_token& stop) {
          LoopbackClient client(port);
          while (!stop.stop_requested() && !error.failed()) {
            error.keep(client.cast(rays.batch().bytes));
            rays_ += rays.size();
          }
        }) {}

  [[nodiscard]] std::uint64_t rays() const { return rays_; }

 private:
  std::atomic<std::uint64_t> rays_ = 0;
  std::jthread thread_;  // last: it uses the rest
};

/// Poses the crowd, each time a frame further.
class Poser {
 public:
  explicit Poser(int port) : client_(port) {}

  Status pose() {
    char body[128];
    const double time_s = double(frame_++) / kCrowdUpdatesPerSecond;
    const int size =
        std::snprintf(body, sizeof(body), R"({"animation_id": 0, "time_s": %.6f, "wrap": "loop"})", time_s);
    const double begin = now_s(ClockKind::kWall);
    const auto answer = client_.put_pose(std::string_view(body, std::size_t(size)));
    if (!answer) return answer.error();
    latencies_ms_.push_back(1000.0 * (now_s(ClockKind::kWall) - begin));
    constexpr std::string_view kRebuild = R"("rebuild")";
    for (std::size_t at = answer->find(kRebuild); at != std::string_view::npos;
         at = answer->find(kRebuild, at + 1))
      ++rebuilds_;
    return ok_status();
  }

  /// Until `end`; a moment that has passed by is left out.
  void keep_pace(const Pace& pace, double end, const std::function<bool()>& go_on, FirstError& error) {
    constexpr double kPeriodSeconds = 1.0 / kCrowdUpdatesPerSecond;
    for (double due = pace.now(); due < end && go_on(); due = std::max(due + kPeriodSeconds, pace.now())) {
      pace.wait_until(due, go_on);
      error.keep(pose());
    }
  }

  [[nodiscard]] const measure::Samples& latencies_ms() const { return latencies_ms_; }
  [[nodiscard]] double rebuilds_per_update() const {
    return double(rebuilds_) / double(std::max<std::size_t>(1, latencies_ms_.size()));
  }

 private:
  LoopbackClient client_;
  std::size_t frame_ = 0;
  std::uint64_t rebuilds_ = 0;
  measure::Samples latencies_ms_;
};

/// Rays that clients got answers for in a phase.
struct Phase {
  double rays = 0.0, seconds = 0.0;
  [[nodiscard]] double rays_per_s() const { return seconds > 0.0 ? rays / seconds : 0.0; }
};

class CrowdOfThreads {
 public:
  CrowdOfThreads(std::size_t threads, ClockKind clock, const std::vector<measure::RaySet>& rays,
                 const measure::BenchOptions& options, const scene::ProgressCallback& progress)
      : pace_(clock, threads), rays_(rays), options_(options), progress_(progress) {
    row_.clock = clock == ClockKind::kProcess ? "cpu" : "wall";
    row_.threads = threads;
    row_.clients = kClients;
    row_.pairs = options.repeat;
    row_.phase_s = options.phase_s;
  }

  Result<measure::CrowdRow> run(const std::shared_ptr<const scene::Scene>& scene) {
    // The server's own threads trace, so the bound has to hold for the whole process.
    const ThreadLimit limit(row_.threads);
    LoopbackServer server(scene, row_.threads);
    const Result<int> port = server.start();
    if (!port) return port.error();
    Poser poser(*port);
    if (Status status = alone(poser); !status) return status.error();
    race(*port, poser);
    if (options_.stop.stop_requested()) return Error{ErrorCode::kCancelled, "the benchmark was stopped", ""};
    if (error_.failed()) return error_.status().error();
    finish(poser);
    return row_;
  }

 private:
  [[nodiscard]] bool go_on() const { return !options_.stop.stop_requested() && !error_.failed(); }

  /// What an update takes of the processors when nobody else wants them.
  Status alone(Poser& poser) {
    if (Status status = poser.pose(); !status) return status;  // opens the connection, deforms all meshes
    const double begin = now_s(ClockKind::kProcess);
    std::size_t posed = 0;
    for (; posed < kLoneUpdates && go_on(); ++posed)
      if (Status status = poser.pose(); !status) return status;
    row_.update_cpu_ms =
        1000.0 * (now_s(ClockKind::kProcess) - begin) / double(std::max<std::size_t>(1, posed));
    return ok_status();
  }

  void race(int port, Poser& poser) {
    std::vector<std::unique_ptr<Caster>> casters;
    for (const measure::RaySet& set : rays_) casters.push_back(std::make_unique<Caster>(port, set, error_));
    // One pair to warm up.
    for (std::size_t pair = 0; pair <= row_.pairs && go_on(); ++pair) {
      const Phase still = phase(casters, nullptr), moving = phase(casters, &poser);
      if (pair == 0) {
        first_update_ = poser.latencies_ms().size();
      } else {
        still_.push_back(still);
        moving_.push_back(moving);
      }
      if (progress_) progress_(double(pair + 1) / double(row_.pairs + 1));
    }
  }

  /// Moving where there is a poser.
  Phase phase(const std::vector<std::unique_ptr<Caster>>& casters, Poser* poser) {
    const auto cast = [&casters] {
      std::uint64_t rays = 0;
      for (const auto& caster : casters) rays += caster->rays();
      return double(rays);
    };
    const auto go_on = [this] { return this->go_on(); };
    const double rays = cast(), begin = pace_.now(), end = begin + options_.phase_s;
    if (poser != nullptr) poser->keep_pace(pace_, end, go_on, error_);
    pace_.wait_until(end, go_on);
    return {cast() - rays, pace_.now() - begin};
  }

  void finish(const Poser& poser) {
    measure::Samples still, moving, ratios;
    double moving_s = 0.0;
    for (std::size_t i = 0; i < still_.size(); ++i) {
      still.push_back(still_[i].rays_per_s());
      moving.push_back(moving_[i].rays_per_s());
      moving_s += moving_[i].seconds;
      if (still.back() > 0.0) ratios.push_back(moving.back() / still.back());
    }
    row_.still_mrays_per_s = 1e-6 * measure::median(std::move(still));
    row_.moving_mrays_per_s = 1e-6 * measure::median(std::move(moving));
    row_.vs_still = measure::median(ratios);
    row_.spread = measure::spread(std::move(ratios));
    const measure::Samples& all = poser.latencies_ms();
    measure::Samples paced(all.begin() + std::ptrdiff_t(first_update_), all.end());
    row_.updates_per_s = moving_s > 0.0 ? double(paced.size()) / moving_s : 0.0;
    std::sort(paced.begin(), paced.end());
    row_.update_p50_ms = measure::median(paced);
    if (!paced.empty()) row_.update_p99_ms = paced[(paced.size() - 1) * 99 / 100];
    row_.rebuilds_per_update = poser.rebuilds_per_update();
  }

  Pace pace_;
  const std::vector<measure::RaySet>& rays_;
  const measure::BenchOptions& options_;
  const scene::ProgressCallback& progress_;
  measure::CrowdRow row_;
  std::vector<Phase> still_, moving_;
  std::size_t first_update_ = 0;  ///< of those that count
  FirstError error_;
};

/// One client looks through a camera, the other sends what bounces off what it sees.
Result<std::vector<measure::RaySet>> rays_of_clients(const measure::BenchScene& crowd,
                                                     const scene::Scene& scene,
                                                     const measure::BenchOptions& options) {
  const measure::RaySetMaker maker(scene, crowd.view, std::min(options.rays, kMostRays), options.seed);
  std::vector<measure::RaySet> sets;
  for (const auto kind : {measure::RaySetKind::kPrimary, measure::RaySetKind::kDiffuse}) {
    auto set = maker.make(kind);
    if (!set) return set.error();
    sets.push_back(*std::move(set));
  }
  return sets;
}

std::uint64_t figure_triangles(const scene::SceneData& data) {
  std::uint64_t triangles = 0;
  for (const scene::InstanceData& instance : data.instances)
    if (instance.skin_id != kInvalidId) triangles += data.meshes[instance.mesh_id]->triangle_count();
  return triangles;
}

}  // namespace

Status bench_crowd(const measure::BenchScene& crowd, const measure::BenchOptions& options,
                   measure::Report& report, const scene::ProgressCallback& progress) {
  const auto scene = scene::build_scene(crowd.data, {{}, options.stop, {}});
  if (!scene) return scene.error();
  const auto rays = rays_of_clients(crowd, **scene, options);
  if (!rays) return rays.error();
  for (const std::size_t threads : options.threads) {
    for (const ClockKind clock : {ClockKind::kWall, ClockKind::kProcess}) {
      auto row = CrowdOfThreads(threads, clock, *rays, options, progress).run(*scene);
      if (!row) return row.error();
      row->scene = crowd.name;
      row->figures = crowd.data.skins.size();
      row->figure_triangles = figure_triangles(crowd.data);
      row->instances = crowd.data.instances.size();
      report.crowd.push_back(*row);
    }
  }
  return ok_status();
}

}  // namespace gridcast::server
