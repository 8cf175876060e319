#include <atomic>
#include <condition_variable>
#include <mutex>

#include <gtest/gtest.h>

#include "server/cli/progress_bar.h"
#include "server/cli/vector_option.h"
#include "server/http/problem.h"
#include "server/http/worker_pool.h"
#include "server/log.h"
#include "server/work_gate.h"

namespace gridcast::server {
namespace {

TEST(ProgressLine, shows_share_and_time_left) {
  EXPECT_EQ(progress_line("tracing", 0.5, 3.0, 80),
            "tracing [====================>                   ]  50 %  3 s left");
  EXPECT_EQ(progress_line("tracing", 0.5, 200.0, 50), "tracing [=======>       ]  50 %  3 min 20 s left");
}

TEST(ProgressLine, fits_any_terminal_and_any_fraction) {
  for (int columns = 1; columns < 120; ++columns)
    for (const double fraction : {-1.0, 0.0, 0.04, 0.999, 1.0, 2.0})
      EXPECT_LT(int(progress_line("rendering", fraction, 1.0, columns).size()), std::max(columns, 2));
}

TEST(Options, vectors_and_sizes_are_read_whole_or_not_at_all) {
  EXPECT_EQ(parse_vector("1,-2.5,3e2"), Vec3d(1.0, -2.5, 300.0));
  for (const char* text : {"", "1,2", "1,2,3,", "1,2,x", "1 2 3", "nan,0,0", "inf,0,0"})
    EXPECT_FALSE(parse_vector(text)) << text;
  EXPECT_EQ(parse_size("640x480"), (std::pair<int, int>(640, 480)));
  for (const char* text : {"", "640", "x480", "640x", "0x1", "-1x1", "70000x1", "6x4x2"})
    EXPECT_FALSE(parse_size(text)) << text;
}

TEST(Log, a_line_cannot_be_forged) {
  EXPECT_EQ(escaped("a\r\nb \"q\" \\ \x1b\xff"), "a\\u000d\\u000ab \\\"q\\\" \\\\ \\u001b\\u00ff");
}

TEST(Problems, cancellation_is_told_by_its_reason) {
  Cancellation deadline;
  deadline.cancel(CancelReason::kDeadline);
  deadline.cancel(CancelReason::kShutdown);  // the first reason stays
  const Error stopped{ErrorCode::kCancelled, "stopped", ""};
  EXPECT_EQ(problem_of(stopped, proto::ErrorContext::kQuery, deadline).status(), 504);
  EXPECT_TRUE(deadline.token().stop_requested());
  Cancellation shutdown;
  shutdown.cancel(CancelReason::kShutdown);
  EXPECT_EQ(problem_of(stopped, proto::ErrorContext::kQuery, shutdown).status(), 503);
}

TEST(Problems, nothing_of_the_machine_leaks) {
  const Error error{ErrorCode::kIo, "cannot open /etc/secret", "/etc/secret"};
  const HttpResponse response =
      problem_response(problem_of(error, proto::ErrorContext::kQuery, Cancellation()));
  EXPECT_EQ(response.status, 500);
  EXPECT_EQ(response.body.find("secret"), std::string::npos);
}

TEST(Cancellation, a_client_can_only_bring_its_deadline_forward) {
  Cancellation cancellation(Clock::now() + std::chrono::seconds(10));
  const auto before = cancellation.deadline();
  cancellation.stop_within(std::chrono::seconds(100));
  EXPECT_EQ(cancellation.deadline(), before);
  cancellation.stop_within(std::chrono::seconds(1));
  EXPECT_LT(cancellation.deadline(), before);
}

TEST(Cancellation, what_a_request_has_waited_counts_and_what_a_job_has_waited_does_not) {
  const auto now = Clock::now();
  Cancellation cancellation(now + std::chrono::seconds(10), now - std::chrono::seconds(2));
  cancellation.stop_within(std::chrono::seconds(5));
  EXPECT_EQ(cancellation.deadline(), now + std::chrono::seconds(3));
  Cancellation job(Clock::time_point::max(), now - std::chrono::seconds(2));
  job.begin();
  job.stop_within(std::chrono::seconds(5));
  EXPECT_GE(job.deadline(), now + std::chrono::seconds(5));
}

TEST(WorkGate, waits_for_a_place_or_for_the_stop) {
  WorkGate gate(1);
  std::stop_source stop;
  {
    const auto first = gate.enter(stop.get_token());
    ASSERT_TRUE(first);
    stop.request_stop();
    EXPECT_FALSE(gate.enter(stop.get_token()));
  }
  EXPECT_TRUE(gate.enter(std::stop_token()));
}

TEST(WorkGate, a_place_can_be_tried_for_and_all_that_came_and_went_is_counted) {
  WorkGate gate(2);
  auto first = gate.try_enter();
  const auto second = gate.enter({});
  EXPECT_TRUE(first);
  EXPECT_FALSE(gate.try_enter());
  EXPECT_EQ(gate.counts().entered, 2U);
  EXPECT_EQ(gate.counts().left, 0U);
  first.reset();
  EXPECT_TRUE(gate.try_enter());
  EXPECT_EQ(gate.counts().entered, 3U);
  EXPECT_EQ(gate.counts().left, 2U);
}

TEST(WorkGate, places_that_come_free_at_once_are_all_taken) {
  // Whoever leaves calls the first alone: the second is called by the first, or nobody.
  for (int round = 0; round < 200; ++round) {
    WorkGate gate(2);
    auto one = gate.enter({}), two = gate.enter({});
    std::stop_source given_up;
    std::atomic<int> inside{0};
    std::vector<std::jthread> threads;
    for (int i = 0; i < 2; ++i) {
      threads.emplace_back([&] {
        const auto permit = gate.enter(given_up.get_token());
        if (!permit) return;
        ++inside;
        while (inside < 2 && !given_up.stop_requested()) std::this_thread::yield();
      });
    }
    while (gate.waiting() < 2) std::this_thread::yield();
    one.reset();
    two.reset();
    const auto end = Clock::now() + std::chrono::seconds(20);
    while (inside < 2 && Clock::now() < end) std::this_thread::yield();
    given_up.request_stop();
    ASSERT_EQ(inside, 2) << "round " << round;
  }
}

TEST(WorkGate, lets_in_whoever_came_first) {
  WorkGate gate(1);
  auto first = gate.enter({});
  std::atomic<int> arrived{0};
  std::vector<int> order;
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    // The next one comes when this one waits; one of them gives up and must not stop the others.
    const std::size_t before = gate.waiting();
    threads.emplace_back([&, i] {
      std::stop_source stop;
      std::jthread impatient;
      if (i == 3) impatient = std::jthread([&] { stop.request_stop(); });
      if (i == 3 && !gate.enter(stop.get_token())) return void(++arrived);
      const auto permit = gate.enter({});
      order.push_back(i);
    });
    while (gate.waiting() == before && arrived == 0) std::this_thread::yield();
    if (i == 3) {
      while (arrived == 0) std::this_thread::yield();
      arrived = 0;
    }
  }
  first.reset();
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 4, 5, 6, 7}));
}

TEST(WorkerPool, refuses_when_all_are_busy_and_the_queue_is_full) {
  std::mutex mutex;
  std::condition_variable changed;
  bool open = false;
  std::atomic<int> started{0};
  std::atomic<int> ran{0};
  const auto blocked = [&] {
    ++started;
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return open; });
    ++ran;
  };
  WorkerPool pool(1, 1);
  std::function<void()> task = blocked;
  while (!pool.try_enqueue(task)) std::this_thread::yield();
  while (started == 0) std::this_thread::yield();
  task = blocked;
  EXPECT_TRUE(pool.try_enqueue(task));
  task = blocked;
  EXPECT_FALSE(pool.try_enqueue(task));
  EXPECT_TRUE(task);  // untouched: the caller still has it
  {
    const std::lock_guard lock(mutex);
    open = true;
  }
  changed.notify_all();
  pool.shut_down();
  EXPECT_EQ(ran, 2);
}

}  // namespace
}  // namespace gridcast::server
