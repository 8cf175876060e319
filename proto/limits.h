#pragma once
// Every limit on what a client may send, with its number and its reason. The server may override the members
// of Limits by flags; GET /v1 publishes the values in force.

#include <cstddef>
#include <cstdint>
#include <string>

namespace gridcast::proto {

/// Of questions about many rays, for each core: under 80 % of the load that a server bears there are hardly
/// more at a time.
inline constexpr std::size_t kHeavyRequestsPerCore = 8;
[[nodiscard]] std::size_t default_heavy_requests();

struct Limits {
  /// About 240,000 rays of six numbers: parsing costs more than tracing, so large batches should be binary.
  std::size_t json_bytes = std::size_t(16) << 20;
  /// Our deepest body (a matrix in a list of moves) has 5 levels; "[[[[..." must not reach any stack.
  std::size_t json_depth = 16;
  std::size_t json_rays = 100'000;
  /// 8 M rays of [8] float32, or 4 M of [8] float64.
  std::size_t binary_bytes = std::size_t(256) << 20;
  std::size_t binary_rays = std::size_t(8) << 20;
  /// What `max_hits` may be, and is when not given.
  std::size_t hits_per_ray = 65'536;
  /// Of all rays of one answer: about 64 MB of JSON, or 200 MB of binary columns. The rows of points/inside
  /// are bounded by the same numbers.
  std::size_t json_hits = 500'000;
  std::size_t binary_hits = std::size_t(4) << 20;
  std::size_t glb_bytes = std::size_t(512) << 20;
  int image_side_px = 8192;
  std::uint32_t explain_steps = 100'000;  ///< of a ray's explanation: about 12 MB of JSON
  /// Width x height x samples: 1080p at 256 samples, or the largest image at 8.
  std::uint64_t image_samples = std::uint64_t(1) << 29;
  int samples_per_pixel = 4096;
  int bounce_depth = 64;  ///< a longer mirror path adds nothing an eye can see
  /// And instances, of a scene whose tradeoffs are measured: several structures of it are in memory at once.
  std::uint64_t tradeoff_triangles = 1'000'000;
  std::size_t tradeoff_accuracy_rays = 200'000;  ///< a class: rates below 15 in a million can be told
  std::size_t tradeoff_speed_rays = 1'000'000;   ///< a class
  std::size_t tradeoff_repeat = 25;
  /// Rays of all methods, classes and repetitions: some minutes of one core.
  std::uint64_t tradeoff_traces = 1'000'000'000;
  /// What fits into json_bytes at about 160 bytes a move.
  std::size_t instances_per_patch = 100'000;
  /// In binary, where a move takes 52 or 100 bytes; all of a scene of a million instances.
  std::size_t binary_instances = std::size_t(2) << 20;
  std::size_t transaction_edits = 100'000;
  /// Of these, poses: each looks at every node, and one may hold any number of weights and joints.
  std::size_t transaction_poses = 100;
  std::size_t instances_per_page = 10'000;  ///< one page is about 3 MB of JSON
  std::size_t name_bytes = 256;
  std::size_t scenes = 1'000;
  double deadline_ms = 30'000.0;  ///< of a request, the time in the queue included
  std::size_t jobs_queued = 64;   ///< waiting, those at work not counted
  std::size_t jobs_kept = 1'000;  ///< that have ended; the oldest are forgotten first
  /// Results of all jobs together: a few of the largest pictures, or hundreds of usual ones.
  std::size_t job_result_bytes = std::size_t(512) << 20;
  double job_keep_ms = 600'000.0;      ///< how long an ended job and its result can be asked for
  double job_deadline_ms = 600'000.0;  ///< of a job's work, without its time in the queue
  /// Answers kept for those who send a request again with its Idempotency-Key: the oldest are forgotten
  /// first.
  std::size_t idempotency_keys = 10'000;
  std::size_t idempotency_bytes = std::size_t(64) << 20;  ///< of all of them together
  double idempotency_keep_ms = 3'600'000.0;
  /// Of the whole process: what adds to scenes and large bodies are refused at 85 %, all new work at 95 %.
  /// 0: no budget.
  std::uint64_t memory_budget_bytes = 0;
  /// Versions of a scene that can be asked for by number, the newest among them. They share what no update
  /// changed; at 70 % of the memory budget the older ones go.
  std::size_t kept_versions = 4;
  /// Of a scene's log of updates, as it is in memory: thousands of moves, or a few frames of a mesh of
  /// 100,000 vertices. The oldest versions go first, all of it at 70 % of the memory budget.
  std::size_t log_bytes = std::size_t(8) << 20;
  /// Versions in one answer of the log, which also ends where it has more than json_bytes.
  std::size_t log_lines = 10'000;
  /// Open streams of events: each holds a connection's thread.
  std::size_t event_streams = 16;
  /// Questions about many rays, points or pairs, at work or waiting for it: so many are never too many. More
  /// are refused when all together would take longer than heavy_wait_ms at the pace of the last ones.
  std::size_t heavy_requests = default_heavy_requests();
  double heavy_wait_ms = 20.0;
  /// Uploads and pictures that one waits for, at once: a quarter of the threads that serve connections, so
  /// that slow senders and large pictures leave the others.
  std::size_t long_requests = 16;
  std::size_t connections_per_address = 0;  ///< at once; 0: no limit
};

/// The `limits` object of GET /v1: one member per field above, same names.
[[nodiscard]] std::string to_json(const Limits& limits);

}  // namespace gridcast::proto
