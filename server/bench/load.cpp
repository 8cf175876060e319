#include "server/bench/load.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/measure/statistics.h"
#include "proto/limits.h"
#include "server/bench/load_clients.h"
#include "server/bench/load_parts.h"
#include "server/bench/loopback.h"
#include "server/thread_limit.h"

namespace gridcast::server {

using measure::ClockKind;
using measure::now_s;

std::string binary_head(std::string_view query) {
  return "POST /v1/scenes/bench/rays/closest" + std::string(query) +
         " HTTP/1.1\r\nHost: 127.0.0.1\r\n"
         "Content-Type: application/vnd.gridcast.rays; dtype=float32; columns=8\r\n"
         "Accept: application/vnd.gridcast.hits\r\n";
}

std::vector<std::byte> LoadBench::repeated_rays(std::size_t count) const {
  const auto set = rays.batch().bytes;
  std::vector<std::byte> bytes(count * rays.batch().row_bytes());
  for (std::size_t at = 0; at < bytes.size(); at += set.size())
    std::copy_n(set.begin(), std::min(set.size(), bytes.size() - at), bytes.begin() + std::ptrdiff_t(at));
  return bytes;
}

std::string json_head() {
  return "POST /v1/scenes/bench/rays/closest HTTP/1.1\r\nHost: 127.0.0.1\r\n"
         "Content-Type: application/json\r\nAccept: application/json\r\n";
}

namespace {

void append_triple(std::string& text, const float* values) {
  std::array<char, 32> digits{};
  for (int i = 0; i < 3; ++i) {
    text += i == 0 ? '[' : ',';
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), values[i]);
    text.append(digits.data(), end.ptr);
  }
  text += ']';
}

/// Origins and directions, whatever the rows' range: a client that asks for the closest hit sends no more.
std::string json_of(const measure::RaySet& rays, std::size_t count) {
  const auto column = [&](std::size_t first) {
    std::string text = "[";
    for (std::size_t i = 0; i < count; ++i) {
      if (i > 0) text += ',';
      append_triple(text, rays.rows[i].data() + first);
    }
    return text + "]";
  };
  return R"({"origins":)" + column(0) + R"(,"directions":)" + column(4) + "}";
}

/// The milliseconds of `phase` in an answer's Server-Timing; 0 when it is not there.
double phase_ms(std::string_view answer, std::string_view phase) {
  const std::string name = std::string(phase) + ";dur=";
  const std::size_t at = answer.substr(0, answer.find("\r\n\r\n")).find(name);
  double ms = 0.0;
  if (at != answer.npos) std::from_chars(answer.data() + at + name.size(), answer.data() + answer.size(), ms);
  return ms;
}

using Part = Status (*)(const LoadBench& bench);

/// Clients apart are those of the saturation alone: the others ask for one thing after the other.
std::span<const Part> parts_of(measure::ClientCores clients) {
  static constexpr std::array<Part, 4> kParts{bench_json_batches, bench_latency, bench_gone,
                                              bench_saturation};
  return clients == measure::ClientCores::kApart ? std::span(kParts).last(1) : std::span(kParts);
}

Status run_parts(LoadBench& bench, measure::ClientCores clients, const std::function<void()>& step) {
  const ThreadLimit limit(bench.threads);
  std::unique_ptr<CoresApart> apart;
  if (clients == measure::ClientCores::kApart) {
    auto made = CoresApart::make(bench.threads);
    if (!made) return made.error();
    apart = std::move(made).value();
    bench.apart = apart.get();
  }
  for (const Part part : parts_of(clients)) {
    if (Status status = part(bench); !status) return status;
    step();
  }
  return ok_status();
}

}  // namespace

Status bench_json_batches(const LoadBench& bench) {
  LoopbackServer server(bench.scene, bench.threads);
  const Result<int> port = server.start();
  if (!port) return port.error();
  LoopbackClient client(*port);
  measure::JsonBatchRow row;
  row.rays = std::min(bench.rays.size(), proto::Limits{}.json_rays);
  const std::string body = json_of(bench.rays, row.rays), head = json_head();
  constexpr std::array<const char*, 4> kPhases{"parse", "wait", "trace", "encode"};
  std::array<measure::Samples, 4> shares;
  measure::Samples speeds, core_speeds;
  for (std::size_t i = 0; i <= bench.options.repeat && !bench.stopped(); ++i) {
    const double begin = now_s(ClockKind::kWall), cpu = now_s(ClockKind::kProcess);
    const auto answer = client.ask(head, std::as_bytes(std::span(body)));
    if (!answer) return answer.error();
    const double seconds = now_s(ClockKind::kWall) - begin, cpu_s = now_s(ClockKind::kProcess) - cpu;
    if (i == 0) continue;  // warms up
    speeds.push_back(1e-6 * double(row.rays) / seconds);
    core_speeds.push_back(1e-6 * double(row.rays) / cpu_s);
    for (std::size_t p = 0; p < kPhases.size(); ++p)
      shares[p].push_back(1e-3 * phase_ms(*answer, kPhases[p]) / seconds);
  }
  row.scene = bench.scene_name;
  row.set = measure::to_string(bench.rays.kind);
  row.threads = bench.threads;
  row.mrays_per_s = measure::median(speeds);
  row.mrays_per_core_s = measure::median(core_speeds);
  row.spread = measure::spread(core_speeds);
  row.parse_share = measure::median(shares[0]);
  row.wait_share = measure::median(shares[1]);
  row.trace_share = measure::median(shares[2]);
  row.encode_share = measure::median(shares[3]);
  bench.report.json_batches.push_back(row);
  return ok_status();
}

Status bench_load(const measure::BenchScene& bench_scene, const measure::BenchOptions& options,
                  measure::Report& report, const scene::ProgressCallback& progress) {
  allow_many_connections();
  const auto scene = scene::build_scene(bench_scene.data, {{}, options.stop, {}});
  if (!scene) return scene.error();
  const measure::RaySetMaker maker(**scene, bench_scene.view, options.rays, options.seed);
  const auto rays = maker.make(measure::RaySetKind::kDiffuse);
  if (!rays) return rays.error();
  std::size_t steps = 0, done = 0;
  for (const measure::ClientCores clients : options.clients)
    steps += parts_of(clients).size() * options.threads.size();
  const auto step = [&] {
    if (progress) progress(double(++done) / double(steps));
  };
  for (const measure::ClientCores clients : options.clients) {
    for (const std::size_t threads : options.threads) {
      LoadBench bench{bench_scene.name, *scene, bench_scene.view, *rays, threads, options, report};
      Status status = run_parts(bench, clients, step);
      if (options.stop.stop_requested()) return Error{ErrorCode::kCancelled, "the benchmark was stopped", ""};
      if (!status) return status;
    }
  }
  return ok_status();
}

}  // namespace gridcast::server
