#include "server/jobs.h"

#include <atomic>
#include <thread>

#include <gtest/gtest.h>

namespace gridcast::server {
namespace {

using proto::Problem;
using proto::ProblemCode;

constexpr Clock::time_point kForever = Clock::time_point::max();

HttpResponse answer(std::string body) {
  return {200, "text/plain", std::move(body), {}};
}

/// Work that goes on until it is told to stop.
JobOutcome until_stopped(Cancellation& cancellation, const scene::ProgressCallback&) {
  while (!cancellation.token().stop_requested()) std::this_thread::yield();
  return Problem{ProblemCode::kCancelled, "stopped", ""};
}

class JobsTest : public ::testing::Test {
 protected:
  void make(std::size_t workers = 1) { jobs_ = std::make_unique<Jobs>(limits_, gate_, workers); }
  std::shared_ptr<Job> submit(JobWork work) {
    auto submitted = jobs_->submit({"render", "lab", 7}, std::move(work));
    return std::holds_alternative<Problem>(submitted) ? nullptr : std::get<std::shared_ptr<Job>>(submitted);
  }
  static JobView ended(const Job& job) { return job.wait_final(kForever, {}).value(); }
  static void wait_running(const Job& job) {
    for (JobView view = job.view(); view.state == JobState::kQueued;)
      view = job.wait_past(view.revision, kForever, {}).value();
  }

  proto::Limits limits_;
  WorkGate gate_{2};
  std::unique_ptr<Jobs> jobs_;
};

TEST_F(JobsTest, a_job_runs_and_keeps_its_result) {
  make();
  const auto job = submit([](Cancellation&, const auto&) -> JobOutcome { return answer("made"); });
  const JobView view = ended(*job);
  EXPECT_EQ(view.state, JobState::kDone);
  EXPECT_EQ(view.progress, 1.0);
  EXPECT_EQ(view.result->body, "made");
  EXPECT_FALSE(view.problem);
  EXPECT_EQ(jobs_->find(job->id()), job);
  EXPECT_EQ(job->id().size(), 32U);
}

TEST_F(JobsTest, other_forms_of_a_result_are_kept_and_weighed_with_it) {
  limits_.job_result_bytes = 10;
  make();
  const auto with_forms = [](const std::string& form) {
    return [form](Cancellation&, const auto&) -> JobOutcome {
      HttpResponse made = answer("made");
      made.other_forms = {{"text/csv", form}};
      return made;
    };
  };
  const auto too_large = submit(with_forms("a,b,c\r\n"));
  EXPECT_EQ(ended(*too_large).state, JobState::kFailed) << "4 bytes and 7";
  const auto fits = submit(with_forms("a,b\r\n"));
  EXPECT_EQ(ended(*fits).result->other_forms.at(0).body, "a,b\r\n");
  EXPECT_EQ(jobs_->counts().result_bytes, 9U);
}

TEST_F(JobsTest, a_problem_and_an_exception_are_failures_and_say_nothing_of_the_inside) {
  make();
  const auto refused = submit([](Cancellation&, const auto&) -> JobOutcome {
    return Problem{ProblemCode::kInvalidValue, "no", "/camera"};
  });
  EXPECT_EQ(ended(*refused).state, JobState::kFailed);
  EXPECT_EQ(ended(*refused).problem->pointer, "/camera");
  const auto thrown =
      submit([](Cancellation&, const auto&) -> JobOutcome { throw std::runtime_error("secret"); });
  EXPECT_EQ(ended(*thrown).state, JobState::kFailed);
  EXPECT_EQ(ended(*thrown).problem->code, ProblemCode::kInternal);
  EXPECT_EQ(ended(*thrown).problem->detail.find("secret"), std::string::npos);
}

TEST_F(JobsTest, progress_grows_whatever_is_reported) {
  make();
  std::vector<double> seen;
  std::atomic<const Job*> self{nullptr};
  const auto job = submit([&](Cancellation&, const auto& progress) -> JobOutcome {
    while (self == nullptr) std::this_thread::yield();
    for (const double fraction : {0.25, 0.125, -1.0, 0.5, 0.5, 7.0}) {
      progress(fraction);
      seen.push_back(self.load()->view().progress);
    }
    return answer("");
  });
  self = job.get();
  EXPECT_EQ(ended(*job).progress, 1.0);
  EXPECT_EQ(seen, (std::vector<double>{0.25, 0.25, 0.25, 0.5, 0.5, 1.0}));
  EXPECT_EQ(job->view().revision, 6U) << "queued, running, three steps, done";
}

TEST_F(JobsTest, of_a_full_queue_the_next_job_is_refused) {
  limits_.jobs_queued = 2;
  make();
  const auto running = submit(until_stopped);
  wait_running(*running);
  const auto first = submit(until_stopped);
  const auto second = submit(until_stopped);
  const auto refused = jobs_->submit({"render", "lab", 7}, until_stopped);
  EXPECT_EQ(std::get<Problem>(refused).code, ProblemCode::kTooManyJobs);
  EXPECT_EQ(jobs_->counts().queued, 2U);
  EXPECT_EQ(jobs_->counts().refused, 1U);
  // A queued job that is cancelled gives its place back at once.
  EXPECT_TRUE(jobs_->remove(second->id()));
  EXPECT_EQ(second->view().state, JobState::kCancelled);
  EXPECT_NE(submit(until_stopped), nullptr);
  EXPECT_EQ(first->view().state, JobState::kQueued);
}

TEST_F(JobsTest, a_running_job_is_cancelled_and_then_forgotten) {
  make();
  const auto job = submit(until_stopped);
  wait_running(*job);
  EXPECT_TRUE(jobs_->remove(job->id()));
  EXPECT_EQ(ended(*job).state, JobState::kCancelled);
  while (jobs_->counts().running > 0) std::this_thread::yield();
  EXPECT_NE(jobs_->find(job->id()), nullptr) << "a cancelled job can be asked for";
  EXPECT_TRUE(jobs_->remove(job->id()));
  EXPECT_EQ(jobs_->find(job->id()), nullptr);
  EXPECT_FALSE(jobs_->remove(job->id()));
}

TEST_F(JobsTest, a_result_that_comes_after_the_cancelling_is_not_kept) {
  make();
  const auto job = submit([](Cancellation& cancellation, const auto&) -> JobOutcome {
    while (!cancellation.token().stop_requested()) std::this_thread::yield();
    return answer("too late");
  });
  wait_running(*job);
  EXPECT_TRUE(jobs_->remove(job->id()));
  EXPECT_EQ(ended(*job).state, JobState::kCancelled);
  EXPECT_EQ(ended(*job).result, nullptr);
  EXPECT_EQ(jobs_->counts().result_bytes, 0U);
}

TEST_F(JobsTest, jobs_wait_for_the_gate_that_requests_use) {
  make();
  auto first = gate_.enter({});
  const auto second = gate_.enter({});
  const auto job = submit([](Cancellation&, const auto&) -> JobOutcome { return answer(""); });
  while (jobs_->counts().running == 0) std::this_thread::yield();
  EXPECT_EQ(job->view().state, JobState::kQueued);
  first.reset();
  EXPECT_EQ(ended(*job).state, JobState::kDone);
}

TEST_F(JobsTest, work_past_its_deadline_fails) {
  limits_.job_deadline_ms = 20.0;
  make();
  const auto job = submit([](Cancellation& cancellation, const auto&) -> JobOutcome {
    while (!cancellation.token().stop_requested()) std::this_thread::yield();
    EXPECT_EQ(cancellation.reason(), CancelReason::kDeadline);
    return Problem{ProblemCode::kDeadlineExceeded, "late", ""};
  });
  EXPECT_EQ(ended(*job).state, JobState::kFailed);
}

TEST_F(JobsTest, the_oldest_results_go_when_there_are_too_many_bytes_or_jobs) {
  limits_.job_result_bytes = 100;
  limits_.jobs_kept = 3;
  make();
  const auto of_size = [&](std::size_t bytes) {
    const auto job =
        submit([bytes](Cancellation&, const auto&) -> JobOutcome { return answer(std::string(bytes, 'x')); });
    (void)ended(*job);
    return job;
  };
  const auto first = of_size(60);
  const auto second = of_size(60);
  const auto huge = of_size(101);
  while (jobs_->counts().running > 0) std::this_thread::yield();
  EXPECT_EQ(jobs_->find(first->id()), nullptr);
  EXPECT_NE(jobs_->find(second->id()), nullptr);
  EXPECT_EQ(huge->view().state, JobState::kFailed);
  EXPECT_EQ(huge->view().problem->code, ProblemCode::kLimitExceeded);
  EXPECT_EQ(jobs_->counts().result_bytes, 60U);
  of_size(1);
  of_size(1);
  while (jobs_->counts().running > 0) std::this_thread::yield();
  EXPECT_EQ(jobs_->find(second->id()), nullptr);
  EXPECT_EQ(jobs_->counts().result_bytes, 2U);
}

TEST_F(JobsTest, an_ended_job_is_forgotten_after_its_time) {
  limits_.job_keep_ms = 1.0;
  make();
  const auto job = submit([](Cancellation&, const auto&) -> JobOutcome { return answer("x"); });
  while (jobs_->find(job->id()) != nullptr) std::this_thread::yield();
  EXPECT_EQ(jobs_->counts().result_bytes, 0U);
}

TEST_F(JobsTest, shutting_down_cancels_all_and_takes_no_more) {
  make();
  const auto running = submit(until_stopped);
  wait_running(*running);
  const auto queued = submit(until_stopped);
  jobs_->shut_down();
  EXPECT_EQ(ended(*running).state, JobState::kCancelled);
  EXPECT_EQ(queued->view().state, JobState::kCancelled);
  const auto refused = jobs_->submit({"render", "lab", 7}, until_stopped);
  EXPECT_EQ(std::get<Problem>(refused).code, ProblemCode::kOverloaded);
}

TEST_F(JobsTest, what_the_work_holds_is_freed_before_the_job_is_seen_to_end) {
  auto held = std::make_shared<int>(1);
  const std::weak_ptr<int> watch = held;
  bool freed = false;
  jobs_ =
      std::make_unique<Jobs>(limits_, gate_, 1, [&](const Job&, const JobView&) { freed = watch.expired(); });
  const auto job =
      submit([held = std::move(held)](Cancellation&, const auto&) -> JobOutcome { return answer("x"); });
  (void)ended(*job);
  jobs_.reset();
  EXPECT_TRUE(freed) << "the job is kept, its scene is not";
}

TEST_F(JobsTest, every_job_ends_once_under_many_threads) {
  std::atomic<int> observed{0};
  jobs_ = std::make_unique<Jobs>(limits_, gate_, 3, [&](const Job&, const JobView&) { ++observed; });
  std::atomic<int> accepted{0};
  const auto client = [&](int seed) {
    for (int i = 0; i < 200; ++i) {
      const auto job = submit([](Cancellation& cancellation, const auto& progress) -> JobOutcome {
        progress(0.5);
        if (cancellation.token().stop_requested()) return Problem{ProblemCode::kCancelled, "", ""};
        return answer("x");
      });
      if (job == nullptr) continue;
      ++accepted;
      if ((i + seed) % 3 == 0) (void)jobs_->remove(job->id());
    }
  };
  std::vector<std::thread> clients;
  for (int seed = 0; seed < 3; ++seed) clients.emplace_back(client, seed);
  for (std::thread& thread : clients) thread.join();
  while (jobs_->counts().queued + jobs_->counts().running > 0) std::this_thread::yield();
  const JobCounts counts = jobs_->counts();
  EXPECT_EQ(observed, accepted);
  EXPECT_EQ(counts.ended[2] + counts.ended[3] + counts.ended[4], std::uint64_t(accepted));
}

}  // namespace
}  // namespace gridcast::server
