#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <map>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "core/measure/statistics.h"
#include "server/bench/load_clients.h"
#include "server/bench/load_parts.h"
#include "server/bench/loopback.h"

namespace gridcast::server {
namespace {

using measure::ClockKind;
using measure::now_s;
using measure::quantile;

/// A camera of the server's: some milliseconds of work for a hundred bytes, so that the clients, who share
/// the cores with the server, can ask for ten times what it can do.
constexpr int kWidthPx = 128, kHeightPx = 96;
constexpr double kSteady = 0.8;

struct Phase {
  const char* name;
  double load;  ///< by the peak
};
constexpr std::array<Phase, 4> kPhases{
    {{"steady", kSteady}, {"whole", 1.0}, {"double", 2.0}, {"tenfold", 10.0}}};

/// What the repetitions of one phase gave.
struct Series {
  measure::Samples offered, goodput, vs_peak, by_cpu, accepted_p50, accepted_p99, vs_steady, refused,
      refused_p50, refused_p99, late, clients, recovery;
  std::uint64_t failed = 0, not_sent = 0;
};

std::string camera_of(const measure::View& view) {
  char body[512];
  const Vec3d &eye = view.eye, &target = view.target;
  const int size =
      std::snprintf(body, sizeof(body),
                    R"({"type":"pinhole","pose":{"eye":[%.9g,%.9g,%.9g],"target":[%.9g,%.9g,%.9g]},)"
                    R"("width_px":%d,"height_px":%d})",
                    eye.x, eye.y, eye.z, target.x, target.y, target.z, kWidthPx, kHeightPx);
  return {body, std::size_t(size)};
}

class Saturation {
 public:
  Saturation(const LoadBench& bench, const LoopbackServer& server, int port)
      : bench_(bench), server_(server), body_(camera_of(bench.view)) {
    plan_.port = port;
    plan_.head =
        "POST /v1/scenes/bench/sensors?fields=instance_id HTTP/1.1\r\nHost: 127.0.0.1\r\n"
        "Content-Type: application/json\r\nAccept: application/vnd.gridcast.hits\r\n";
    plan_.body = std::as_bytes(std::span(body_));
    plan_.seconds = bench.options.phase_s;
    plan_.seed = bench.options.seed;
    plan_.stop = bench.options.stop;
  }

  Status run() {
    peak_per_s_ = find_peak();
    if (peak_per_s_ <= 0.0 && !bench_.stopped())
      return Error{ErrorCode::kIo, "no request was answered", "/load"};
    for (std::size_t i = 0; i < bench_.options.repeat && !bench_.stopped(); ++i) repeat();
    for (const auto& [name, series] : series_) report(name, series);
    return ok_status();
  }

 private:
  /// How many requests at a time give most; the first look also warms up.
  double find_peak() {
    double best = 0.0;
    for (const std::size_t at_once : {1U, 2U, 4U, 8U, 16U}) {
      LoadPlan plan = plan_;
      plan.in_flight = at_once * bench_.threads;
      plan.seconds = 0.5 * plan_.seconds;
      const LoadOutcome found = run_load(plan);
      const double goodput = double(found.accepted_in_time) / std::max(found.seconds, 1e-9);
      if (goodput > best) at_once_ = plan.in_flight;
      best = std::max(best, goodput);
    }
    return best;
  }

  /// A peak, and the loads that go by the best one so far: where other programs run, one look may find less.
  void repeat() {
    LoadPlan plan = plan_;
    plan.in_flight = at_once_;
    const double cpu = now_s(ClockKind::kProcess);
    const LoadOutcome peak = run_load(plan);
    const double spent_at_peak = now_s(ClockKind::kProcess) - cpu;
    per_cpu_s_ = by_server_cpu(peak, spent_at_peak);
    keep("0 peak", peak, spent_at_peak, 0.0);
    double steady_p99 = 0.0;
    for (std::size_t i = 0; i < kPhases.size() && !bench_.stopped(); ++i) {
      settle();
      plan.in_flight = 0;
      plan.per_s = std::max(1.0, kPhases[i].load * peak_per_s_);
      ++plan.seed;
      const double before = now_s(ClockKind::kProcess);
      const LoadOutcome outcome = run_load(plan);
      const double spent = now_s(ClockKind::kProcess) - before;
      if (i == 0) steady_p99 = quantile(outcome.accepted_ms, 0.99);
      Series& series = keep(std::to_string(i + 1) + " " + kPhases[i].name, outcome, spent, steady_p99);
      series.recovery.push_back(recovery_s(steady_p99));
    }
    plan_.seed = plan.seed;
  }

  /// The load before has left nothing.
  void settle() const {
    constexpr double kMostSeconds = 5.0;
    const double until = now_s(ClockKind::kWall) + kMostSeconds;
    while (server_.requests_in_flight() > 0 && now_s(ClockKind::kWall) < until && !bench_.stopped())
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }

  /// One request after the other, until 20 in a row are answered as under the steady load.
  double recovery_s(double steady_p99_ms) const {
    constexpr std::size_t kGood = 20;
    constexpr double kMostSeconds = 10.0;
    LoadPlan plan = plan_;
    plan.in_flight = 1;
    plan.seconds = 1e-9;  // one request
    const double begin = now_s(ClockKind::kWall);
    double normal_since = 0.0;
    for (std::size_t good = 0; good < kGood && !bench_.stopped();) {
      const LoadOutcome one = run_load(plan);
      const double now = now_s(ClockKind::kWall) - begin;
      const bool is_good = one.accepted_ms.size() == 1 && one.accepted_ms[0] <= steady_p99_ms;
      good = is_good ? good + 1 : 0;
      if (!is_good) normal_since = now;
      if (now > kMostSeconds) break;
    }
    return normal_since;
  }

  static double by_server_cpu(const LoadOutcome& outcome, double cpu_s) {
    return double(outcome.accepted_ms.size()) / std::max(cpu_s - outcome.cpu_s, 1e-9);
  }

  Series& keep(const std::string& name, const LoadOutcome& outcome, double cpu_s, double steady_p99_ms) {
    Series& series = series_[name];
    const double seconds = std::max(outcome.seconds, 1e-9);
    const double goodput = double(outcome.accepted_in_time) / seconds;
    const double p99 = quantile(outcome.accepted_ms, 0.99);
    // Whatever has been answered in a second can be: the peak is the best of all loads, also those in the
    // open.
    peak_per_s_ = std::max(peak_per_s_, goodput);
    series.offered.push_back(double(outcome.sent + outcome.not_sent) / seconds);
    series.goodput.push_back(goodput);
    series.vs_peak.push_back(goodput / std::max(peak_per_s_, 1e-9));
    series.by_cpu.push_back(by_server_cpu(outcome, cpu_s) / std::max(per_cpu_s_, 1e-9));
    series.accepted_p50.push_back(measure::median(outcome.accepted_ms));
    series.accepted_p99.push_back(p99);
    series.vs_steady.push_back(steady_p99_ms > 0.0 ? p99 / steady_p99_ms : 0.0);
    series.refused.push_back(double(outcome.refused_ms.size()) / seconds);
    series.refused_p50.push_back(measure::median(outcome.refused_ms));
    series.refused_p99.push_back(quantile(outcome.refused_ms, 0.99));
    series.late.push_back(quantile(outcome.late_ms, 0.99));
    series.clients.push_back(cpu_s > 0.0 ? outcome.cpu_s / cpu_s : 0.0);
    series.failed += outcome.failed;
    series.not_sent += outcome.not_sent;
    return series;
  }

  void report(const std::string& name, const Series& series) const {
    measure::LoadRow row;
    row.scene = bench_.scene_name;
    row.phase = name.substr(2);
    row.clients = bench_.apart != nullptr ? measure::ClientCores::kApart : measure::ClientCores::kShared;
    row.threads = bench_.threads;
    row.rays = std::uint64_t(kWidthPx) * kHeightPx;
    row.repeat = series.goodput.size();
    row.phase_s = bench_.options.phase_s;
    row.offered_per_s = measure::median(series.offered);
    row.goodput_per_s = measure::median(series.goodput);
    row.vs_peak = measure::median(series.vs_peak);
    row.spread = measure::spread(name == "0 peak" ? series.goodput : series.vs_peak);
    row.vs_peak_by_cpu = measure::median(series.by_cpu);
    row.accepted_p50_ms = measure::median(series.accepted_p50);
    row.accepted_p99_ms = measure::median(series.accepted_p99);
    row.vs_steady_p99 = measure::median(series.vs_steady);
    row.refused_per_s = measure::median(series.refused);
    row.refused_p50_ms = measure::median(series.refused_p50);
    row.refused_p99_ms = measure::median(series.refused_p99);
    row.failed = series.failed;
    row.not_sent = series.not_sent;
    row.late_p99_ms = measure::median(series.late);
    row.clients_share = measure::median(series.clients);
    row.recovery_s = measure::median(series.recovery);
    bench_.report.load.push_back(row);
  }

  const LoadBench& bench_;
  const LoopbackServer& server_;
  const std::string body_;
  LoadPlan plan_;
  std::size_t at_once_ = 1;
  double peak_per_s_ = 0.0, per_cpu_s_ = 0.0;
  std::map<std::string, Series> series_;  ///< in the order of the phases
};

}  // namespace

Status bench_saturation(const LoadBench& bench) {
  LoopbackServer server(bench.scene, bench.threads, HttpServerOptions{});
  const Result<int> port = server.start();
  if (!port) return port.error();
  if (bench.apart != nullptr) bench.apart->be_client();
  return Saturation(bench, server, *port).run();
}

}  // namespace gridcast::server
