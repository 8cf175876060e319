// Who is served first when threads are few, and who is refused: counted, never timed.

#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "server/http/heavy_load.h"
#include "server/http/small_request.h"
#include "tests/unit/server/http/few_threads.h"

namespace gridcast::server {
namespace {

HttpHead head(const std::string& method, const std::string& target, std::uint64_t body_bytes) {
  HttpHead made;
  made.method = method;
  made.target = target;
  made.framing = body_bytes > 0 ? BodyFraming::kLength : BodyFraming::kNone;
  made.content_length = body_bytes;
  return made;
}

TEST(SmallRequest, is_a_probe_or_a_question_about_a_few_rays) {
  EXPECT_TRUE(is_small_request(head("GET", "/healthz/live", 0)));
  EXPECT_TRUE(is_small_request(head("HEAD", "/healthz/ready", 0)));
  EXPECT_TRUE(is_small_request(head("POST", "/v1/scenes/a/rays/closest?precision=exact", kSmallBodyBytes)));
  EXPECT_TRUE(is_small_request(head("POST", "/v1/scenes/a/rays/any", 60)));
  EXPECT_FALSE(is_small_request(head("POST", "/v1/scenes/a/rays/closest", kSmallBodyBytes + 1)));
  EXPECT_FALSE(is_small_request(head("POST", "/v1/scenes/a/rays/all", 60))) << "few rays, many hits";
  EXPECT_FALSE(is_small_request(head("POST", "/v1/scenes/a/sensors", 60))) << "a small body, many rays";
  EXPECT_FALSE(is_small_request(head("POST", "/v1/scenes/a/renders", 60)));
  EXPECT_FALSE(is_small_request(head("GET", "/v1/scenes/a/structure", 0)));
  EXPECT_FALSE(is_small_request(head("GET", "/v1/scenes?x=/healthz/", 0)));
  HttpHead chunked = head("POST", "/v1/scenes/a/rays/any", 60);
  chunked.framing = BodyFraming::kChunked;
  EXPECT_FALSE(is_small_request(chunked)) << "nobody knows how much will come";
  HttpHead packed = head("POST", "/v1/scenes/a/rays/any", 60);
  packed.headers.emplace_back("content-encoding", "zstd");
  EXPECT_FALSE(is_small_request(packed)) << "nor how much there is";
}

TEST(HeavyRequest, is_a_question_about_many) {
  EXPECT_TRUE(is_heavy_request(head("POST", "/v1/scenes/a/rays/closest", kSmallBodyBytes + 1)));
  EXPECT_TRUE(is_heavy_request(head("POST", "/v1/scenes/a/sensors?fields=t", 60)));
  EXPECT_TRUE(is_heavy_request(head("POST", "/v1/scenes/a/points/inside", 60)));
  EXPECT_TRUE(is_heavy_request(head("POST", "/v1/scenes/a/visibility", 60)));
  EXPECT_FALSE(is_heavy_request(head("POST", "/v1/scenes/a/rays/closest", 60)));
  EXPECT_FALSE(is_heavy_request(head("PATCH", "/v1/scenes/a/instances", 1 << 20)));
  EXPECT_FALSE(is_heavy_request(head("POST", "/v1/scenes?name=/sensors", 1 << 20)));
}

TEST(LongRequest, is_an_upload_or_a_picture) {
  EXPECT_TRUE(is_long_request(head("POST", "/v1/scenes?name=a", 1 << 20)));
  EXPECT_TRUE(is_long_request(head("POST", "/v1/scenes/a/renders", 60)));
  EXPECT_TRUE(is_long_request(head("PUT", "/v1/scenes/a/meshes/0", 1 << 20)));
  EXPECT_FALSE(is_long_request(head("PUT", "/v1/scenes/a/meshes/0/weights", 60)));
  EXPECT_FALSE(is_long_request(head("POST", "/v1/scenes/a/sensors", 60)));
  EXPECT_FALSE(is_long_request(head("GET", "/v1/scenes", 0)));
}

/// Takes `count` requests through, each `ms` after the one before.
Clock::time_point pass(HeavyLoad& load, int count, milliseconds ms) {
  Clock::time_point now{};
  for (int i = 0; i < count; ++i) {
    EXPECT_TRUE(load.try_enter(now));
    now += ms;
    load.leave(now);
  }
  return now;
}

TEST(HeavyLoad, refuses_what_would_wait_too_long_at_the_pace_of_the_last_ones) {
  HeavyLoad load(4);
  const Clock::time_point now = pass(load, 200, milliseconds(2));
  int taken = 0;
  while (taken < 1000 && load.try_enter(now)) ++taken;
  // 2 ms each, 20 ms at most: the eleventh finds more than that before it.
  EXPECT_GE(taken, 10);
  EXPECT_LE(taken, 12);
  EXPECT_TRUE(load.is_full());
  load.leave(now + milliseconds(2));
  load.leave(now + milliseconds(4));
  EXPECT_FALSE(load.is_full());
  EXPECT_TRUE(load.try_enter(now + milliseconds(4)));
}

TEST(HeavyLoad, some_are_never_too_many) {
  HeavyLoad load(4);
  const Clock::time_point now = pass(load, 50, milliseconds(5000));
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(load.try_enter(now)) << i;
  EXPECT_FALSE(load.try_enter(now));
}

TEST(HeavyLoad, a_burst_of_quick_ones_is_taken) {
  HeavyLoad load(4);
  const Clock::time_point now = pass(load, 200, milliseconds(0));
  for (int i = 0; i < 500; ++i) EXPECT_TRUE(load.try_enter(now)) << i;
}

TEST(HeavyLoad, an_idle_time_is_not_taken_for_work) {
  HeavyLoad load(1);
  Clock::time_point now = pass(load, 200, milliseconds(1));
  now += std::chrono::hours(1);
  ASSERT_TRUE(load.try_enter(now));
  load.leave(now + milliseconds(1));
  for (int i = 0; i < 15; ++i) EXPECT_TRUE(load.try_enter(now)) << i;
}

TEST(HeavyLoad, who_waits_for_a_client_keeps_nobody_out_and_its_wait_is_no_work) {
  HeavyLoad load(1);
  Clock::time_point now = pass(load, 200, milliseconds(30));
  ASSERT_TRUE(load.try_enter(now));
  EXPECT_TRUE(load.is_full());
  load.pause(now + milliseconds(10));
  EXPECT_FALSE(load.is_full());
  now += std::chrono::hours(1);
  load.resume(now);
  EXPECT_TRUE(load.is_full());
  load.leave(now + milliseconds(10));
  // Had the hour been work, one at a time would wait for minutes from now on; it is some 30 ms as before.
  now = pass(load, 200, milliseconds(1));
  for (int i = 0; i < 15; ++i) EXPECT_TRUE(load.try_enter(now)) << i;
}

TEST(Lanes, probes_and_few_rays_are_answered_while_every_thread_is_taken) {
  FewThreads server(100);
  server.hold();
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(has(Client(server.port()).send(get("/healthz/live")).read_all(), "live"));
    const std::string post =
        "POST /v1/scenes/a/rays/closest HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\n"
        "Content-Length: 5\r\nConnection: close\r\n\r\nhello";
    EXPECT_TRUE(has(Client(server.port()).send(post).read_all(), "5 bytes"));
  }
  EXPECT_EQ(server.in_flight(), 2U) << "both threads were taken all the while";
  // On a connection that goes on with something else it waits for a thread like everybody.
  Client mixed(server.port());
  mixed.send(get("/healthz/live", "") + get("/other"));
  server.release();
  const std::string answers = mixed.read_all();
  EXPECT_TRUE(has(answers, "live")) << answers;
  EXPECT_TRUE(has(answers, "other")) << answers;
}

TEST(Lanes, a_busy_connection_gives_its_thread_to_those_who_wait) {
  FewThreads server(100);
  server.hold(get("/after-other"));
  Client other(server.port());
  other.send(get("/other"));
  // Long enough to be in the queue. Without turns both threads would go on to what waits for it.
  std::this_thread::sleep_for(milliseconds(200));
  server.release();
  EXPECT_TRUE(has(other.read_all(), "other"));
  for (Client& held : server.held()) {
    const std::string answers = held.read_all();
    EXPECT_FALSE(has(answers, "in vain")) << answers;
    EXPECT_NE(answers.find("came"), answers.rfind("came")) << answers;
  }
}

TEST(Lanes, who_still_sends_a_body_is_told_of_the_refusal) {
  FewThreads server(0);
  server.hold();
  int went_through = 0;
  for (int i = 0; i < 20; ++i) {
    Client client(server.port());
    client.send(
        "POST /v1/scenes/a/rays/closest HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\n"
        "Content-Length: 90000\r\n\r\n" +
        std::string(45'000, 'x'));
    std::this_thread::sleep_for(milliseconds(20));
    // Were the connection closed at once, this would fail, and many clients would not look for an answer.
    went_through += client.try_send(std::string(45'000, 'x')) ? 1 : 0;
    const std::string answer = client.read_all();
    EXPECT_TRUE(has(answer, "HTTP/1.1 503")) << answer;
    EXPECT_TRUE(has(answer, "Retry-After: ")) << answer;
  }
  EXPECT_GE(went_through, 10) << "it is read and thrown away for a while";
}

}  // namespace
}  // namespace gridcast::server
