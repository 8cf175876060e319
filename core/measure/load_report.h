#pragma once
// What the section `load` found, as rows: a server under its clients, all in one process on the loopback
// address. Latencies are from the first byte of a request (or the opening of its connection) to the last of
// its answer. `vs_...` are medians over repetitions.

#include <cstddef>
#include <cstdint>
#include <string>

namespace gridcast::measure {

/// The cores of the clients of a server that is measured.
enum class ClientCores : std::uint8_t {
  kShared,  ///< those of the server
  kApart,   ///< one of their own, which the server has not: they live on other machines
};
[[nodiscard]] constexpr const char* to_string(ClientCores cores) {
  return cores == ClientCores::kApart ? "apart" : "shared";
}

/// A batch of rays in JSON, both ways.
struct JsonBatchRow {
  std::string scene, set;
  std::size_t threads = 1;
  std::uint64_t rays = 0;
  double mrays_per_s = 0.0;
  /// By the CPU time of the process, the client's sending and reading included: what one core does in a
  /// second, whatever else runs on the machine.
  double mrays_per_core_s = 0.0;
  double spread = 0.0;  ///< of the latter
  /// Of the time between the request's first byte and the answer's last, by Server-Timing; the rest is sent,
  /// received or waited for.
  double parse_share = 0.0, wait_share = 0.0, trace_share = 0.0, encode_share = 0.0;
};

/// Requests of one kind, one after the other, beside whatever else the server has to bear.
struct LatencyRow {
  std::string scene;
  std::string what;    ///< constant, one_ray, health, one_ray_connecting
  std::string beside;  ///< nothing, one_batch, five_batches, drips
  std::size_t threads = 1;
  std::uint64_t requests = 0, failed = 0;
  double p50_ms = 0.0, p99_ms = 0.0;
  /// Of one_ray by those of `constant`, a handler of the same HTTP library that does nothing; beside
  /// anything, by those beside nothing. Above 1 is slower. 0: nothing to compare with.
  double vs_base_p50 = 0.0, vs_base_p99 = 0.0;
  double spread = 0.0;  ///< of the first of them that the goal is about
};

/// Small batches, as fast as they are answered (`peak`) or at moments that do not wait for answers.
struct LoadRow {
  std::string scene, phase;  ///< peak, steady (0.8 of the peak), whole, double, tenfold
  ClientCores clients = ClientCores::kShared;
  std::size_t threads = 1;
  std::uint64_t rays = 0;  ///< of a batch
  std::size_t repeat = 0;
  double phase_s = 0.0;
  double offered_per_s = 0.0, goodput_per_s = 0.0;  ///< requests; those answered with 200
  double vs_peak = 0.0;                             ///< goodput by that of the peak
  double spread = 0.0;                              ///< of vs_peak
  /// The same for what is answered in a second of the server's CPU time: whatever else the machine does.
  double vs_peak_by_cpu = 0.0;
  double accepted_p50_ms = 0.0, accepted_p99_ms = 0.0;
  double vs_steady_p99 = 0.0;  ///< of accepted, by that of `steady`; 0 for the peak
  double refused_per_s = 0.0, refused_p50_ms = 0.0, refused_p99_ms = 0.0;
  std::uint64_t failed = 0;    ///< no whole answer came
  std::uint64_t not_sent = 0;  ///< the clients had no connection left
  double late_p99_ms = 0.0;    ///< how late the clients were to send
  double clients_share = 0.0;  ///< of the CPU time of the process
  double recovery_s = 0.0;     ///< until requests are answered as before; 0: at once
};

/// A client that closes its connection while its batch is worked on.
struct GoneRow {
  std::string scene;
  std::size_t threads = 1;
  std::uint64_t rays = 0, trials = 0;
  double median_ms = 0.0, p99_ms = 0.0, worst_ms = 0.0;  ///< until the server has nothing at work
};

}  // namespace gridcast::measure
