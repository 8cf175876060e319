#pragma once
// Many clients at once, all of them with one thread: what loads a server until it has to refuse.

#include <cstddef>
#include <cstdint>
#include <span>
#include <stop_token>
#include <string>

#include "core/measure/statistics.h"

namespace gridcast::server {

/// What the clients do. Every other request of a load in the open comes on a connection of its own, which
/// ends with it; the rest take turns on connections that are kept.
struct LoadPlan {
  int port = 0;
  std::string head;  ///< of a request, without its last lines
  std::span<const std::byte> body;
  /// Closed loop: so many requests at every moment, but for 10 ms after each refusal; 0: open loop.
  std::size_t in_flight = 0;
  double per_s = 0.0;  ///< open loop: requests a second, at the moments of a Poisson process
  double seconds = 1.0;
  std::size_t most_connections = 2000;  ///< a request for which none is left is not sent
  std::uint64_t seed = 1;
  std::stop_token stop;
};

/// Answers count when they come before the end of the time; those to requests at work then are waited for,
/// a second at most, and counted among the latencies alone.
struct LoadOutcome {
  measure::Samples accepted_ms, refused_ms;  ///< 200; 429 and 503
  measure::Samples late_ms;                  ///< behind the moment that a request was due
  std::uint64_t sent = 0, accepted_in_time = 0, failed = 0, not_sent = 0;
  double seconds = 0.0;
  double cpu_s = 0.0;  ///< of the clients' thread
};

[[nodiscard]] LoadOutcome run_load(const LoadPlan& plan);

/// Lets this process open as many descriptors as it may.
void allow_many_connections();

}  // namespace gridcast::server
