#include <algorithm>
#include <chrono>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "core/measure/statistics.h"
#include "server/bench/load_parts.h"
#include "server/bench/loopback.h"

namespace gridcast::server {
namespace {

using measure::ClockKind;
using measure::now_s;

/// Trials for each repetition that was asked for.
constexpr std::size_t kTrialsPerRepetition = 10;
/// A batch takes longer than anybody takes to notice that its client has gone.
constexpr double kLeastSeconds = 0.4;
constexpr std::size_t kMostRays = std::size_t(8) << 20;

void sleep_s(double seconds) {
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}

}  // namespace

Status bench_gone(const LoadBench& bench) {
  LoopbackServer server(bench.scene, bench.threads);
  const Result<int> port = server.start();
  if (!port) return port.error();
  std::vector<std::byte> batch = bench.repeated_rays(std::min(bench.rays.size(), kMostRays));
  double whole_s = 0.0;
  // Twice the rays until a whole answer takes long enough.
  for (;;) {
    LoopbackClient client(*port);
    const double begin = now_s(ClockKind::kWall);
    if (Status status = client.cast(batch); !status) return status;
    whole_s = now_s(ClockKind::kWall) - begin;
    const std::size_t rays = batch.size() / bench.rays.batch().row_bytes();
    if (whole_s >= kLeastSeconds || 2 * rays > kMostRays || bench.stopped()) break;
    batch = bench.repeated_rays(2 * rays);
  }
  std::mt19937_64 random(bench.options.seed);
  std::uniform_real_distribution<double> moment(0.0, whole_s);
  measure::Samples ms;
  for (std::size_t i = 0; i < kTrialsPerRepetition * bench.options.repeat && !bench.stopped(); ++i) {
    LoopbackClient client(*port);
    if (Status status = client.send(batch); !status) return status;
    sleep_s(moment(random));
    client.hang_up();
    const double begin = now_s(ClockKind::kWall);
    const bool was_at_work = server.requests_in_flight() > 0;
    while (server.requests_in_flight() > 0) sleep_s(2e-4);
    // Not counted: the answer was there, or the batch had not begun.
    if (was_at_work) ms.push_back(1000.0 * (now_s(ClockKind::kWall) - begin));
  }
  measure::GoneRow row;
  row.scene = bench.scene_name;
  row.threads = bench.threads;
  row.rays = batch.size() / bench.rays.batch().row_bytes();
  row.trials = ms.size();
  row.median_ms = measure::median(ms);
  row.p99_ms = measure::quantile(ms, 0.99);
  row.worst_ms = measure::quantile(ms, 1.0);
  bench.report.gone.push_back(row);
  return ok_status();
}

}  // namespace gridcast::server
