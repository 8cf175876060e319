#pragma once
// Jobs on the wire: their JSON and their server-sent events.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "proto/error_table.h"

namespace gridcast::proto {

/// GET /v1/jobs/{j}, and the data of every event.
struct JobInfo {
  std::string id;
  std::string kind;  ///< render, tradeoffs, ...
  std::string scene;
  std::uint64_t scene_version = 0;
  std::string state;       ///< queued, running, done, failed, cancelled
  double progress = 0.0;   ///< in [0, 1]
  std::string created_at;  ///< RFC 3339, UTC
  double wait_ms = 0.0;    ///< in the queue, so far or until it ran
  double run_ms = 0.0;     ///< at work, so far or in all
  struct Result {
    std::string media_type;
    std::size_t bytes = 0;
  };
  std::optional<Result> result;    ///< of a job that is done
  std::optional<Problem> problem;  ///< of one that failed or was cancelled
};

[[nodiscard]] std::string to_json(const JobInfo& info);

inline constexpr std::string_view kEventsMediaType = "text/event-stream";

/// One event of text/event-stream; `data` is a single line.
[[nodiscard]] std::string event_text(std::string_view name, std::uint64_t id, std::string_view data);
/// A comment line: keeps the connection open, no client sees an event.
inline constexpr std::string_view kHeartbeat = ": heartbeat\n\n";

}  // namespace gridcast::proto
