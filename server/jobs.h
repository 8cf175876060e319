#pragma once
// Work that outlives its request: a bounded queue, a few workers, progress to watch, results kept for a
// while.

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <variant>
#include <vector>

#include "core/scene/scene.h"
#include "proto/error_table.h"
#include "proto/limits.h"
#include "server/http/http_types.h"
#include "server/work_gate.h"

namespace gridcast::server {

/// In the order of a job's life; the last three are final.
enum class JobState : std::uint8_t { kQueued, kRunning, kDone, kFailed, kCancelled };
inline constexpr std::size_t kJobStates = 5;
[[nodiscard]] std::string_view to_string(JobState state);
[[nodiscard]] constexpr bool is_final(JobState state) {
  return state >= JobState::kDone;
}

/// What a job is about.
struct JobSubject {
  std::string kind;  ///< render, tradeoffs
  std::string scene;
  std::uint64_t scene_version = 0;
  std::string owner = {};  ///< the name of the token that started it; empty without access control
};

/// What a job gives: an answer to be fetched later, or what went wrong.
using JobOutcome = std::variant<HttpResponse, proto::Problem>;
/// The work. It stops soon after `cancellation` says so, and may report progress from any thread.
using JobWork =
    std::function<JobOutcome(Cancellation& cancellation, const scene::ProgressCallback& progress)>;

/// A job at one moment.
struct JobView {
  std::uint64_t revision = 1;  ///< grows with every change
  JobState state = JobState::kQueued;
  double progress = 0.0;                       ///< in [0, 1]; never falls
  double wait_ms = 0.0;                        ///< in the queue, so far or until it ran
  double run_ms = 0.0;                         ///< at work, so far or in all
  std::shared_ptr<const HttpResponse> result;  ///< of kDone
  std::optional<proto::Problem> problem;       ///< of kFailed and kCancelled
};

/// One job as its watchers see it. Any thread may call.
class Job {
 public:
  Job(std::string id, JobSubject subject) : id_(std::move(id)), subject_(std::move(subject)) {}

  [[nodiscard]] const std::string& id() const { return id_; }
  [[nodiscard]] const JobSubject& subject() const { return subject_; }
  [[nodiscard]] std::chrono::system_clock::time_point created() const { return created_; }

  [[nodiscard]] JobView view() const;
  /// A view newer than `revision`; nothing when `until` or `stop` came first.
  [[nodiscard]] std::optional<JobView> wait_past(std::uint64_t revision, Clock::time_point until,
                                                 const std::stop_token& stop) const;
  /// The view of a job that has ended, likewise.
  [[nodiscard]] std::optional<JobView> wait_final(Clock::time_point until, const std::stop_token& stop) const;

 private:
  friend class Jobs;
  void start();
  void report(double fraction);
  void end(JobState state, JobOutcome outcome);
  [[nodiscard]] JobView view_locked() const;

  const std::string id_;
  const JobSubject subject_;
  const std::chrono::system_clock::time_point created_ = std::chrono::system_clock::now();
  const Clock::time_point queued_at_ = Clock::now();
  Cancellation cancellation_;

  mutable std::mutex mutex_;
  mutable std::condition_variable_any changed_;
  JobView now_;
  std::optional<Clock::time_point> started_at_;
  std::optional<Clock::time_point> ended_at_;
};

struct JobCounts {
  std::size_t queued = 0;
  std::size_t running = 0;
  std::size_t result_bytes = 0;
  std::uint64_t refused = 0;                      ///< since the start: the queue was full
  std::array<std::uint64_t, kJobStates> ended{};  ///< since the start, by final state
};

/// All jobs of a server.
class Jobs {
 public:
  using Observer = std::function<void(const Job&, const JobView&)>;  ///< of every job that has ended

  /// Each job at work holds a place of `gate`, like a request. `gate` outlives the jobs.
  Jobs(const proto::Limits& limits, WorkGate& gate, std::size_t workers, Observer observer = {});
  /// Cancels all and waits for the workers.
  ~Jobs();
  Jobs(const Jobs&) = delete;
  Jobs& operator=(const Jobs&) = delete;

  /// too_many_jobs when the queue is full, overloaded after shut_down().
  [[nodiscard]] std::variant<std::shared_ptr<Job>, proto::Problem> submit(JobSubject subject, JobWork work);
  /// Null for one that never was or is forgotten.
  [[nodiscard]] std::shared_ptr<Job> find(const std::string& id) const;
  /// Cancels a job that has not ended (it stays to be asked for), forgets one that has. False when unknown.
  bool remove(const std::string& id);
  /// Cancels every job and takes no more. Does not wait.
  void shut_down();

  [[nodiscard]] JobCounts counts() const;

 private:
  struct Queued {
    std::shared_ptr<Job> job;
    JobWork work;
  };
  struct Ended {
    std::shared_ptr<Job> job;
    std::size_t bytes = 0;
    Clock::time_point forget_at;
  };

  void work(const std::stop_token& ending);
  [[nodiscard]] JobOutcome run(const Queued& queued);
  /// Under mutex_.
  void end(const std::shared_ptr<Job>& job, JobOutcome outcome);
  void forget_oldest();
  /// Cancels jobs past their deadline and forgets those kept long enough.
  void keep_house(const std::stop_token& ending);

  const proto::Limits limits_;
  WorkGate& gate_;
  const Observer observer_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::map<std::string, std::shared_ptr<Job>> jobs_;
  std::deque<Queued> queue_;
  std::vector<std::shared_ptr<Job>> running_;  ///< with a worker, waiting for the gate or at work
  std::deque<Ended> ended_;                    ///< the oldest first
  JobCounts counts_;
  std::uint64_t changes_ = 0;  ///< of running_ and ended_
  bool closed_ = false;
  std::vector<std::jthread> threads_;  // last: they use the rest
};

}  // namespace gridcast::server
