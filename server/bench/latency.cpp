#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "core/measure/statistics.h"
#include "server/bench/dripping_clients.h"
#include "server/bench/httplib_yardstick.h"
#include "server/bench/load_parts.h"
#include "server/bench/loopback.h"

namespace gridcast::server {
namespace {

using measure::ClockKind;
using measure::now_s;
using measure::Samples;

constexpr std::string_view kOneRay = R"({"origins":[[0,0,4]],"directions":[[0,0,-1]]})";
/// Of one kind, in one repetition and turn.
constexpr std::size_t kRequests = 300;
/// The largest batch that the server takes, or so many times the rays of the set.
constexpr std::size_t kMostBatchRays = std::size_t(8) << 20, kBatchSets = 8;
constexpr std::size_t kDrips = 1000;

/// A way to ask, again and again.
struct Question {
  const char* what;
  std::function<Status()> ask;
};

/// Milliseconds of every request, by repetition.
struct Latencies {
  std::vector<Samples> ms;
  std::uint64_t failed = 0;

  [[nodiscard]] Samples all() const {
    Samples together;
    for (const Samples& some : ms) together.insert(together.end(), some.begin(), some.end());
    return together;
  }
  /// Of quantile `q` by that of `base`, repetition by repetition.
  [[nodiscard]] Samples against(const Latencies& base, double q) const {
    Samples ratios;
    for (std::size_t i = 0; i < std::min(ms.size(), base.ms.size()); ++i) {
      const double below = measure::quantile(base.ms[i], q);
      if (below > 0.0) ratios.push_back(measure::quantile(ms[i], q) / below);
    }
    return ratios;
  }
};

void ask_often(const LoadBench& bench, const Question& question, std::size_t requests, Latencies& into) {
  Samples ms;
  for (std::size_t i = 0; i < requests && !bench.stopped(); ++i) {
    const double begin = now_s(ClockKind::kWall);
    if (question.ask())
      ms.push_back(1000.0 * (now_s(ClockKind::kWall) - begin));
    else
      ++into.failed;
  }
  into.ms.push_back(std::move(ms));
}

void add_row(const LoadBench& bench, const char* what, const char* beside, const Latencies& found,
             const Latencies* base, double goal_q) {
  measure::LatencyRow row;
  row.scene = bench.scene_name;
  row.what = what;
  row.beside = beside;
  row.threads = bench.threads;
  const Samples all = found.all();
  row.requests = all.size();
  row.failed = found.failed;
  row.p50_ms = measure::quantile(all, 0.5);
  row.p99_ms = measure::quantile(all, 0.99);
  if (base != nullptr) {
    row.vs_base_p50 = measure::median(found.against(*base, 0.5));
    row.vs_base_p99 = measure::median(found.against(*base, 0.99));
    row.spread = measure::spread(found.against(*base, goal_q));
  }
  bench.report.latency.push_back(row);
}

/// Sends a batch again and again, from construction to destruction.
class BatchClient {
 public:
  BatchClient(int port, std::span<const std::byte> batch)
      : thread_([port, batch](const std::stop_token& stop) {
          LoopbackClient client(port);
          while (!stop.stop_requested())
            if (!client.cast(batch) && !stop.stop_requested()) std::this_thread::yield();
        }) {}

 private:
  std::jthread thread_;
};

class LatencyBench {
 public:
  LatencyBench(const LoadBench& bench, int port, int yardstick_port)
      : bench_(bench), port_(port), kept_(port), constant_(yardstick_port), probe_(port) {}

  Status run() {
    // A first answer opens the connections.
    for (const Question& question : {constant(), one_ray(), health()})
      if (Status status = question.ask(); !status) return status;
    alone();
    beside_batches("one_batch", 1);
    beside_batches("five_batches", 5);
    beside_drips();
    return ok_status();
  }

 private:
  Question constant() {
    return {"constant", [this] { return ask(constant_, json_head(), kOneRay); }};
  }
  Question one_ray() {
    return {"one_ray", [this] { return ask(kept_, json_head(), kOneRay); }};
  }
  Question health() {
    return {"health",
            [this] { return ask(probe_, "GET /healthz/live HTTP/1.1\r\nHost: 127.0.0.1\r\n", {}); }};
  }
  Question one_ray_connecting() {
    return {"one_ray_connecting", [this] {
              LoopbackClient fresh(port_);
              return ask(fresh, json_head() + "Connection: close\r\n", kOneRay);
            }};
  }
  static Status ask(LoopbackClient& client, const std::string& head, std::string_view body) {
    const auto answer = client.ask(head, std::as_bytes(std::span(body)));
    return answer ? ok_status() : Status(answer.error());
  }

  void alone() {
    Latencies constant_ms;
    for (std::size_t i = 0; i < bench_.options.repeat && !bench_.stopped(); ++i) {
      ask_often(bench_, constant(), kRequests, constant_ms);
      ask_often(bench_, one_ray(), kRequests, one_ray_ms_);
      ask_often(bench_, health(), kRequests, health_ms_);
    }
    add_row(bench_, "constant", "nothing", constant_ms, nullptr, 0.5);
    add_row(bench_, "one_ray", "nothing", one_ray_ms_, &constant_ms, 0.5);
    add_row(bench_, "health", "nothing", health_ms_, &constant_ms, 0.5);
  }

  void beside_batches(const char* beside, std::size_t clients) {
    const std::vector<std::byte> batch =
        bench_.repeated_rays(std::min(kMostBatchRays, kBatchSets * bench_.rays.size()));
    Latencies rays, probes;
    {
      std::vector<std::unique_ptr<BatchClient>> batches;
      for (std::size_t i = 0; i < clients; ++i)
        batches.push_back(std::make_unique<BatchClient>(port_, batch));
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
      for (std::size_t i = 0; i < bench_.options.repeat && !bench_.stopped(); ++i) {
        ask_often(bench_, one_ray(), kRequests / 10, rays);
        ask_often(bench_, health(), kRequests / 10, probes);
      }
    }
    add_row(bench_, "one_ray", beside, rays, &one_ray_ms_, 0.99);
    add_row(bench_, "health", beside, probes, &health_ms_, 0.99);
  }

  /// In turns with and without drips.
  void beside_drips() {
    Latencies kept_without, kept_with, connecting_without, connecting_with;
    for (std::size_t i = 0; i < bench_.options.repeat && !bench_.stopped(); ++i) {
      ask_often(bench_, one_ray(), kRequests, kept_without);
      ask_often(bench_, one_ray_connecting(), kRequests, connecting_without);
      const DrippingClients drips(port_, kDrips);
      ask_often(bench_, one_ray(), kRequests, kept_with);
      ask_often(bench_, one_ray_connecting(), kRequests, connecting_with);
    }
    add_row(bench_, "one_ray", "drips", kept_with, &kept_without, 0.99);
    add_row(bench_, "one_ray_connecting", "nothing", connecting_without, nullptr, 0.99);
    add_row(bench_, "one_ray_connecting", "drips", connecting_with, &connecting_without, 0.99);
  }

  const LoadBench& bench_;
  const int port_;
  LoopbackClient kept_, constant_, probe_;
  Latencies one_ray_ms_, health_ms_;
};

}  // namespace

Status bench_latency(const LoadBench& bench) {
  LoopbackServer server(bench.scene, bench.threads, HttpServerOptions{});
  HttplibYardstick yardstick;
  const Result<int> port = server.start(), yardstick_port = yardstick.start();
  if (!port) return port.error();
  if (!yardstick_port) return yardstick_port.error();
  return LatencyBench(bench, *port, *yardstick_port).run();
}

}  // namespace gridcast::server
