#include "server/jobs.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <exception>
#include <new>
#include <random>
#include <utility>

#include "server/http/problem.h"
#include "server/log.h"

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

constexpr std::chrono::milliseconds kDeadlinePeriod{50};  // how often deadlines of jobs at work are looked at

/// 128 random bits: not guessed, and not met again after a restart.
std::string make_id() {
  thread_local std::random_device random;
  char text[33];
  std::snprintf(text, sizeof(text), "%08x%08x%08x%08x", random(), random(), random(), random());
  return text;
}

std::size_t size_of(const HttpResponse& result) {
  std::size_t bytes = result.body.size();
  for (const HttpResponse::Form& form : result.other_forms) bytes += form.body.size();
  return bytes;
}

Clock::duration of_ms(double ms) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double, std::milli>(ms));
}

}  // namespace

std::string_view to_string(JobState state) {
  constexpr std::array<std::string_view, kJobStates> kNames{"queued", "running", "done", "failed",
                                                            "cancelled"};
  return kNames[std::size_t(state)];
}

JobView Job::view_locked() const {
  JobView view = now_;
  const Clock::time_point now = Clock::now();
  view.wait_ms = ms_between(queued_at_, started_at_.value_or(ended_at_.value_or(now)));
  if (started_at_) view.run_ms = ms_between(*started_at_, ended_at_.value_or(now));
  return view;
}

JobView Job::view() const {
  const std::lock_guard lock(mutex_);
  return view_locked();
}

std::optional<JobView> Job::wait_past(std::uint64_t revision, Clock::time_point until,
                                      const std::stop_token& stop) const {
  std::unique_lock lock(mutex_);
  if (!changed_.wait_until(lock, stop, until, [&] { return now_.revision > revision; })) return std::nullopt;
  return view_locked();
}

std::optional<JobView> Job::wait_final(Clock::time_point until, const std::stop_token& stop) const {
  std::unique_lock lock(mutex_);
  if (!changed_.wait_until(lock, stop, until, [&] { return is_final(now_.state); })) return std::nullopt;
  return view_locked();
}

void Job::start() {
  const std::lock_guard lock(mutex_);
  now_.state = JobState::kRunning;
  started_at_ = Clock::now();
  ++now_.revision;
  changed_.notify_all();
}

void Job::report(double fraction) {
  const std::lock_guard lock(mutex_);
  // Reports of several threads may overtake each other.
  if (now_.state != JobState::kRunning || !(fraction > now_.progress)) return;
  now_.progress = std::min(fraction, 1.0);
  ++now_.revision;
  changed_.notify_all();
}

void Job::end(JobState state, JobOutcome outcome) {
  const std::lock_guard lock(mutex_);
  now_.state = state;
  ended_at_ = Clock::now();
  if (state == JobState::kDone) now_.progress = 1.0;
  if (auto* response = std::get_if<HttpResponse>(&outcome))
    now_.result = std::make_shared<const HttpResponse>(std::move(*response));
  else
    now_.problem = std::get<Problem>(std::move(outcome));
  ++now_.revision;
  changed_.notify_all();
}

Jobs::Jobs(const proto::Limits& limits, WorkGate& gate, std::size_t workers, Observer observer)
    : limits_(limits), gate_(gate), observer_(std::move(observer)) {
  threads_.emplace_back([this](const std::stop_token& ending) { keep_house(ending); });
  for (std::size_t i = 0; i < workers; ++i)
    threads_.emplace_back([this](const std::stop_token& ending) { work(ending); });
}

Jobs::~Jobs() {
  shut_down();
}

std::variant<std::shared_ptr<Job>, Problem> Jobs::submit(JobSubject subject, JobWork work) {
  auto job = std::make_shared<Job>(make_id(), std::move(subject));
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return Problem{ProblemCode::kOverloaded, "the server is shutting down", ""};
    if (queue_.size() >= limits_.jobs_queued) {
      ++counts_.refused;
      return Problem{ProblemCode::kTooManyJobs,
                     std::to_string(limits_.jobs_queued) + " jobs are waiting already", ""};
    }
    queue_.push_back({job, std::move(work)});
    jobs_.emplace(job->id(), job);
  }
  changed_.notify_all();
  return job;
}

std::shared_ptr<Job> Jobs::find(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto found = jobs_.find(id);
  return found == jobs_.end() ? nullptr : found->second;
}

bool Jobs::remove(const std::string& id) {
  Queued dropped;  // what the work holds is freed after the lock
  const std::lock_guard lock(mutex_);
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) return false;
  const std::shared_ptr<Job> job = found->second;
  job->cancellation_.cancel(CancelReason::kRequested);
  const auto same = [&](const auto& entry) { return entry.job == job; };
  if (const auto queued = std::find_if(queue_.begin(), queue_.end(), same); queued != queue_.end()) {
    dropped = std::move(*queued);
    queue_.erase(queued);
    end(job, cancelled_problem(CancelReason::kRequested));
  } else if (const auto ended = std::find_if(ended_.begin(), ended_.end(), same); ended != ended_.end()) {
    counts_.result_bytes -= ended->bytes;
    ended_.erase(ended);
    jobs_.erase(id);
  }
  return true;
}

void Jobs::shut_down() {
  std::deque<Queued> dropped;
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    for (const std::shared_ptr<Job>& job : running_) job->cancellation_.cancel(CancelReason::kShutdown);
    for (const Queued& queued : queue_) {
      queued.job->cancellation_.cancel(CancelReason::kShutdown);
      end(queued.job, cancelled_problem(CancelReason::kShutdown));
    }
    dropped.swap(queue_);
  }
  changed_.notify_all();
}

JobCounts Jobs::counts() const {
  const std::lock_guard lock(mutex_);
  JobCounts counts = counts_;
  counts.queued = queue_.size();
  counts.running = running_.size();
  return counts;
}

void Jobs::work(const std::stop_token& ending) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, ending, [this] { return !queue_.empty(); })) {
    Queued queued = std::move(queue_.front());
    queue_.pop_front();
    running_.push_back(queued.job);
    ++changes_;
    lock.unlock();
    changed_.notify_all();
    JobOutcome outcome = run(queued);
    queued.work = nullptr;  // the scene's version that it holds is freed now
    lock.lock();
    std::erase(running_, queued.job);
    end(queued.job, std::move(outcome));
  }
}

JobOutcome Jobs::run(const Queued& queued) try {
  Job& job = *queued.job;
  const auto permit = gate_.enter(job.cancellation_.token());
  if (!permit) return cancelled_problem(job.cancellation_.reason());
  job.start();
  job.cancellation_.begin();
  job.cancellation_.stop_within(std::chrono::duration<double, std::milli>(limits_.job_deadline_ms));
  return queued.work(job.cancellation_, [&job](double fraction) { job.report(fraction); });
} catch (const std::bad_alloc&) {
  return Problem{ProblemCode::kOverloaded, "not enough memory for this job", ""};
} catch (const std::exception& error) {
  // Its text may name files or hold a client's bytes.
  log_error(error.what());
  return Problem{ProblemCode::kInternal, "an unexpected error; see the server's log", ""};
}

void Jobs::end(const std::shared_ptr<Job>& job, JobOutcome outcome) {
  const CancelReason reason = job->cancellation_.reason();
  JobState state = std::holds_alternative<HttpResponse>(outcome) ? JobState::kDone : JobState::kFailed;
  std::size_t bytes = state == JobState::kDone ? size_of(std::get<HttpResponse>(outcome)) : 0;
  if (bytes > limits_.job_result_bytes) {
    state = JobState::kFailed;
    outcome = Problem{ProblemCode::kLimitExceeded,
                      "the result is larger than " + std::to_string(limits_.job_result_bytes) + " bytes", ""};
  }
  // A result that came while the client was told that there will be none is not kept.
  if (reason == CancelReason::kRequested || reason == CancelReason::kShutdown) {
    state = JobState::kCancelled;
    outcome = cancelled_problem(reason);
  }
  if (state != JobState::kDone) bytes = 0;
  job->end(state, std::move(outcome));
  ++counts_.ended[std::size_t(state)];
  counts_.result_bytes += bytes;
  ended_.push_back({job, bytes, Clock::now() + of_ms(limits_.job_keep_ms)});
  while (ended_.size() > limits_.jobs_kept || counts_.result_bytes > limits_.job_result_bytes)
    forget_oldest();
  ++changes_;
  changed_.notify_all();
  if (observer_) observer_(*job, job->view());
}

void Jobs::forget_oldest() {
  counts_.result_bytes -= ended_.front().bytes;
  jobs_.erase(ended_.front().job->id());
  ended_.pop_front();
}

void Jobs::keep_house(const std::stop_token& ending) {
  std::unique_lock lock(mutex_);
  while (!ending.stop_requested()) {
    const Clock::time_point now = Clock::now();
    while (!ended_.empty() && ended_.front().forget_at <= now) forget_oldest();
    for (const std::shared_ptr<Job>& job : running_)
      if (now >= job->cancellation_.deadline()) job->cancellation_.cancel(CancelReason::kDeadline);
    Clock::time_point next = ended_.empty() ? now + std::chrono::hours(1) : ended_.front().forget_at;
    if (!running_.empty()) next = now + kDeadlinePeriod;
    const std::uint64_t seen = changes_;
    changed_.wait_until(lock, ending, next, [&] { return changes_ != seen; });
  }
}

}  // namespace gridcast::server
