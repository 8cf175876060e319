// Who is served first when threads are few, and who is refused: counted, never timed.

#include <algorithm>
#include <atomic>
#include <list>
#include <stdexcept>
#include <string>
#include <thread>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/heavy_load.h"
#include "server/http_server.h"
#include "server/small_request.h"

namespace gridcast::server {
namespace {

using std::chrono::milliseconds;

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

class Client {
 public:
  explicit Client(int port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  }
  ~Client() { ::close(socket_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  [[nodiscard]] bool try_send(const std::string& text) const {
    return ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL) == ssize_t(text.size());
  }
  Client& send(const std::string& text) {
    EXPECT_EQ(::send(socket_, text.data(), text.size(), MSG_NOSIGNAL), ssize_t(text.size()));
    return *this;
  }
  /// Everything until the server closes; "cut" at its end when it does so with a reset.
  std::string read_all() {
    std::string text;
    char piece[4096];
    ssize_t n = 0;
    while ((n = ::recv(socket_, piece, sizeof(piece), 0)) > 0) text.append(piece, std::size_t(n));
    return n < 0 ? text + "cut" : text;
  }

 private:
  int socket_;
};

std::string get(const std::string& path, const std::string& more = "Connection: close\r\n") {
  return "GET " + path + " HTTP/1.1\r\nHost: x\r\n" + more + "\r\n";
}
bool has(const std::string& answer, const std::string& part) {
  return answer.find(part) != std::string::npos;
}

/// Two threads, and requests that keep them as long as a test wants.
class FewThreads {
 public:
  /// `heavy`: so many heavy requests at once, and no more.
  explicit FewThreads(std::size_t queued, std::size_t heavy = 1000)
      : server_(routes(), options(queued, heavy), [](const RequestRecord&) {}) {
    port_ = server_.bind().value();
    thread_ = std::thread([this] { server_.serve(); });
  }
  ~FewThreads() {
    release_ = true;
    server_.stop();
    thread_.join();
  }
  FewThreads(const FewThreads&) = delete;
  FewThreads& operator=(const FewThreads&) = delete;

  /// Keeps both threads until release(); `after` comes behind it on the same connections.
  void hold(const std::string& after = {}) {
    for (int i = 0; i < 2; ++i)
      held_.emplace_back(port_).send(get("/hold", after.empty() ? "Connection: close\r\n" : "") + after);
    while (server_.requests_in_flight() < 2) std::this_thread::yield();
  }
  void release() { release_ = true; }
  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] std::size_t in_flight() const { return server_.requests_in_flight(); }
  [[nodiscard]] int started() const { return started_; }
  std::list<Client>& held() { return held_; }

 private:
  static HttpServerOptions options(std::size_t queued, std::size_t heavy) {
    HttpServerOptions made;
    made.port = 0;
    made.connection_threads = 2;
    made.max_queued_connections = queued;
    made.heavy_requests = heavy;
    made.heavy_wait = milliseconds(-1);
    made.deadline = std::chrono::seconds(20);
    return made;
  }
  /// Answers 200 as soon as `flag` is there, 503 when its deadline comes first.
  Handler when(const std::atomic<bool>& flag) {
    return [this, &flag](const HttpRequest&, Cancellation& cancellation) {
      ++started_;
      while (!flag && !cancellation.token().stop_requested()) std::this_thread::yield();
      return HttpResponse{flag ? 200 : 503, "text/plain", flag ? "came" : "waited in vain", {}};
    };
  }
  /// Counts the x of a body by pieces; a y ends it there and an e is an exception.
  HttpResponse take_pieces(const HttpRequest& request) {
    if (request.incoming == nullptr) return {200, "text/plain", "whole", {}};
    std::string piece;
    std::size_t count = 0, waits = 0;
    while (request.incoming->bytes_left() > 0) {
      piece.resize(std::min<std::size_t>(100'000, request.incoming->bytes_left()));
      if (const auto problem = request.incoming->read(piece, [&] { ++waits; }))
        return {problem->status(), "text/plain", problem->detail, {}};
      if (piece[0] == 'y') return {422, "text/plain", "enough", {}};
      if (piece[0] == 'e') throw std::runtime_error("secret");
      count += std::size_t(std::ranges::count(piece, 'x'));
    }
    return {200, "text/plain", std::to_string(count) + (waits > 0 ? " in time" : " at once"), {}};
  }
  Router routes() {
    Router router;
    router.add({"GET", "/hold", {}, when(release_)});
    router.add({"GET", "/after-other", {}, when(other_)});
    router.add({"POST", "/v1/scenes/{s}/sensors", {{"text/plain", 100}}, when(release_)});
    router.add({"POST",
                "/v1/scenes/{s}/rays/any",
                {{"text/plain", std::size_t(8) << 20}},
                [this](const HttpRequest& request, Cancellation&) { return take_pieces(request); },
                BodyArrival::kOnTheWay});
    router.add({"GET", "/other", {}, [this](const HttpRequest&, Cancellation&) {
                  other_ = true;
                  return HttpResponse{200, "text/plain", "other", {}};
                }});
    router.add({"GET", "/healthz/live", {}, [](const HttpRequest&, Cancellation&) {
                  return HttpResponse{200, "text/plain", "live", {}};
                }});
    router.add({"POST",
                "/v1/scenes/{s}/rays/closest",
                {{"text/plain", 100'000}},
                [](const HttpRequest& request, Cancellation&) {
                  return HttpResponse{200, "text/plain", std::to_string(request.body.size()) + " bytes", {}};
                }});
    return router;
  }

  std::atomic<bool> release_{false}, other_{false};
  std::atomic<int> started_{0};  ///< of those that wait for a flag
  HttpServer server_;
  int port_ = 0;
  std::list<Client> held_;
  std::thread thread_;
};

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

std::string ask_sensor(const std::string& more = "") {
  return "POST /v1/scenes/a/sensors HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: 2\r\n" +
         more + "\r\nhi";
}
std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != text.npos; at = text.find(part, at + 1)) ++found;
  return found;
}

TEST(Refusal, a_connection_whose_whole_request_came_goes_on) {
  FewThreads server(100, 1);
  Client held(server.port());
  held.send(ask_sensor("Connection: close\r\n"));
  while (server.started() < 1) std::this_thread::yield();
  Client client(server.port());
  const std::string answers =
      client.send(ask_sensor() + ask_sensor() + get("/healthz/live", "") + ask_sensor() + get("/other")).read_all();
  EXPECT_EQ(count(answers, "HTTP/1.1 503"), 3U) << answers;
  EXPECT_EQ(count(answers, "Retry-After: "), 3U) << answers;
  EXPECT_EQ(count(answers, "HTTP/1.1 200"), 2U) << answers;
  EXPECT_LT(answers.find("live"), answers.find("other")) << answers;
  EXPECT_EQ(server.in_flight(), 1U);
  server.release();
  EXPECT_TRUE(has(held.read_all(), "came"));
}

TEST(Refusal, a_last_request_or_one_that_is_still_sent_ends_its_connection) {
  FewThreads server(100, 1);
  Client held(server.port());
  held.send(ask_sensor("Connection: close\r\n"));
  while (server.started() < 1) std::this_thread::yield();
  std::string answers = Client(server.port()).send(ask_sensor("Connection: close\r\n") + get("/other")).read_all();
  EXPECT_EQ(count(answers, "HTTP/1.1"), 1U) << answers;
  EXPECT_TRUE(has(answers, "503") && has(answers, "Connection: close")) << answers;
  // What stands behind a body that has not come is no request.
  std::string begun = ask_sensor();
  begun.pop_back();
  answers = Client(server.port()).send(begun).read_all();
  EXPECT_EQ(count(answers, "HTTP/1.1 503"), 1U) << answers;
  EXPECT_TRUE(has(answers, "Connection: close")) << answers;
}

constexpr std::size_t kLarge = 5'000'000;
std::string pieces_head(std::size_t bytes = kLarge) {
  return "POST /v1/scenes/a/rays/any HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: " +
         std::to_string(bytes) + "\r\n\r\n";
}

TEST(Pieces, a_large_body_is_read_as_it_comes_and_the_next_request_follows) {
  FewThreads server(100);
  const std::string small = pieces_head(20'000) + std::string(20'000, 'x');
  const std::string answers =
      Client(server.port()).send(pieces_head() + std::string(kLarge, 'x') + small + get("/other")).read_all();
  EXPECT_EQ(count(answers, "HTTP/1.1 200"), 3U) << answers;
  EXPECT_TRUE(has(answers, "5000000 ")) << answers;
  EXPECT_TRUE(has(answers, "whole")) << answers;
  EXPECT_TRUE(has(answers, "other")) << answers;
}

TEST(Pieces, what_is_left_of_a_body_is_never_taken_for_a_request) {
  for (const char end : {'y', 'e'}) {
    FewThreads server(100);
    std::string body(kLarge, 'x');
    body[200'000] = end;
    body.replace(300'000, 100, get("/other") + std::string(100 - get("/other").size(), ' '));
    Client client(server.port());
    (void)client.try_send(pieces_head() + body + get("/other"));
    const std::string answers = client.read_all();
    EXPECT_EQ(count(answers, "HTTP/1.1"), 1U) << answers;
    EXPECT_TRUE(has(answers, end == 'y' ? "enough" : "500")) << answers;
    EXPECT_FALSE(has(answers, "secret")) << answers;
    EXPECT_FALSE(has(answers, "\r\n\r\nother")) << answers;
  }
}

TEST(Pieces, who_sends_slowly_is_no_load) {
  FewThreads server(100, 1);
  Client slow(server.port());
  slow.send(pieces_head() + std::string(kLarge - 1, 'x'));
  while (server.in_flight() < 1) std::this_thread::yield();
  // Until it waits, it is at work.
  std::string answer;
  for (int i = 0; i < 1000 && !has(answer, "came"); ++i) {
    server.release();
    answer = Client(server.port()).send(ask_sensor("Connection: close\r\n")).read_all();
  }
  EXPECT_TRUE(has(answer, "came")) << answer;
  EXPECT_EQ(server.in_flight(), 1U);
  slow.send("x" + get("/other"));
  answer = slow.read_all();
  EXPECT_TRUE(has(answer, "5000000 in time")) << answer;
}

TEST(Pieces, a_client_that_goes_ends_the_work) {
  FewThreads server(100);
  { Client(server.port()).send(pieces_head() + std::string(1'000'000, 'x')); }
  for (int i = 0; i < 10'000 && server.in_flight() > 0; ++i) std::this_thread::sleep_for(milliseconds(1));
  EXPECT_EQ(server.in_flight(), 0U);
}

}  // namespace
}  // namespace gridcast::server
