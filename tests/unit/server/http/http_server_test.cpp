#include "server/http/http_server.h"

#include <atomic>
#include <list>
#include <mutex>
#include <thread>

#include <gtest/gtest.h>

#include "server/memory_budget.h"
#include "tests/unit/server/http/raw_client.h"

namespace gridcast::server {
namespace {

/// A server on a free port with three small routes.
class RunningServer {
 public:
  explicit RunningServer(HttpServerOptions options = {})
      : server_(routes(), with_port(std::move(options)), [this](const RequestRecord& record) {
          const std::lock_guard lock(mutex_);
          records_.push_back(record);
        }) {
    port_ = server_.bind().value();
    thread_ = std::thread([this] { server_.serve(); });
  }
  ~RunningServer() { stop(); }

  void stop() {
    server_.stop();
    if (thread_.joinable()) thread_.join();
  }
  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] CancelReason last_reason() const { return reason_; }
  [[nodiscard]] int streams_started() const { return streams_started_; }
  [[nodiscard]] int streams_ended() const { return streams_ended_; }
  [[nodiscard]] std::size_t in_flight() const { return server_.requests_in_flight(); }

 private:
  static HttpServerOptions with_port(HttpServerOptions options) {
    options.port = 0;
    options.connection_threads = 4;
    return options;
  }
  Router routes() {
    Router router;
    router.add({"GET", "/echo/{x}", {}, [](const HttpRequest& request, Cancellation&) {
                  return HttpResponse{200, "text/plain", request.capture("x"), {}};
                }});
    router.add({"POST", "/echo", {{"text/plain", 100}}, [](const HttpRequest& request, Cancellation&) {
                  return HttpResponse{200, "text/plain", request.body, {}};
                }});
    router.add({"GET", "/throw", {}, [](const HttpRequest&, Cancellation&) -> HttpResponse {
                  throw std::runtime_error("secret");
                }});
    router.add({"GET", "/wait", {}, [this](const HttpRequest&, Cancellation& cancellation) {
                  while (!cancellation.token().stop_requested()) std::this_thread::yield();
                  reason_ = cancellation.reason();
                  return HttpResponse{503, "text/plain", "stopped", {}};
                }});
    router.add({"GET", "/ticks", {}, ticking(3)});
    router.add({"GET", "/endless", {}, ticking(0)});
    return router;
  }

  /// Says "tick" until the client goes or the server stops; the first `count` of them at once.
  Handler ticking(int count) {
    return [this, count](const HttpRequest&, Cancellation&) {
      HttpResponse response{200, "text/event-stream", "", {}};
      response.stream = [this, count](const Cancellation& cancellation, const WritePart& write) {
        ++streams_started_;
        for (int i = 0; count == 0 || i < count; ++i)
          if (cancellation.token().stop_requested() || !write("tick\n")) break;
        reason_ = cancellation.reason();
        ++streams_ended_;
      };
      return response;
    };
  }

  std::atomic<CancelReason> reason_{CancelReason::kNone};
  std::atomic<int> streams_started_{0};
  std::atomic<int> streams_ended_{0};
  std::mutex mutex_;
  std::vector<RequestRecord> records_;
  HttpServer server_;
  int port_ = 0;
  std::thread thread_;
};

constexpr const char* kEnd = "Host: x\r\nConnection: close\r\n\r\n";

TEST(HttpServer, answers_and_keeps_the_connection_for_the_next_request) {
  RunningServer server;
  const std::string answer = ask(server.port(), std::string("GET /echo/one HTTP/1.1\r\nHost: x\r\n\r\n") +
                                                    "GET /echo/two HTTP/1.1\r\n" + kEnd);
  EXPECT_EQ(answer.rfind("HTTP/1.1 200", 0), 0U);
  EXPECT_TRUE(has(answer, "one")) << answer;
  EXPECT_TRUE(has(answer, "two")) << answer;
  EXPECT_TRUE(has(answer, "X-Request-Id: ")) << answer;
}

TEST(HttpServer, head_has_the_length_but_no_body) {
  RunningServer server;
  const std::string answer = ask(server.port(), std::string("HEAD /echo/word HTTP/1.1\r\n") + kEnd);
  EXPECT_TRUE(has(answer, "Content-Length: 4")) << answer;
  EXPECT_FALSE(has(answer, "word")) << answer;
}

TEST(HttpServer, unknown_paths_and_methods_are_problems) {
  RunningServer server;
  EXPECT_TRUE(has(ask(server.port(), std::string("GET /nothing HTTP/1.1\r\n") + kEnd), "HTTP/1.1 404"));
  const std::string answer = ask(server.port(), std::string("DELETE /echo HTTP/1.1\r\n") + kEnd);
  EXPECT_TRUE(has(answer, "HTTP/1.1 405")) << answer;
  EXPECT_TRUE(has(answer, "Allow: POST")) << answer;
  EXPECT_TRUE(has(answer, "application/problem+json")) << answer;
}

TEST(HttpServer, bodies_are_read_by_length_and_by_chunks) {
  RunningServer server;
  const std::string start = "POST /echo HTTP/1.1\r\nContent-Type: text/plain\r\n";
  EXPECT_TRUE(has(ask(server.port(), start + "Content-Length: 5\r\n" + kEnd + "hello"), "\r\n\r\nhello"));
  EXPECT_TRUE(has(ask(server.port(), start + "Transfer-Encoding: chunked\r\n" + kEnd +
                                         "3\r\nhel\r\n2;x=y\r\nlo\r\n0\r\nTrailer: z\r\n\r\n"),
                  "\r\n\r\nhello"));
}

TEST(HttpServer, bodies_that_cannot_be_taken_are_refused_before_they_are_read) {
  RunningServer server;
  const std::string post = "POST /echo HTTP/1.1\r\n";
  const std::string plain = post + "Content-Type: text/plain\r\n";
  EXPECT_TRUE(has(ask(server.port(), plain + "Content-Length: 101\r\n" + kEnd), "HTTP/1.1 413"));
  EXPECT_TRUE(
      has(ask(server.port(), plain + "Transfer-Encoding: chunked\r\n" + kEnd + "65\r\n"), "HTTP/1.1 413"));
  EXPECT_TRUE(has(ask(server.port(), plain + kEnd), "HTTP/1.1 411"));
  EXPECT_TRUE(has(ask(server.port(), post + "Content-Type: text/html\r\nContent-Length: 3\r\n" + kEnd),
                  "HTTP/1.1 415"));
  EXPECT_TRUE(has(ask(server.port(), plain + "Content-Encoding: gzip\r\nContent-Length: 3\r\n" + kEnd),
                  "HTTP/1.1 415"));
  for (const char* chunks : {"-1\r\n", "0x1\r\n", "fffffffffffffffff\r\n", "1\r\nab\r\n", "\r\n"})
    EXPECT_TRUE(
        has(ask(server.port(), plain + "Transfer-Encoding: chunked\r\n" + kEnd + chunks), "HTTP/1.1 400"))
        << chunks;
}

TEST(HttpServer, a_body_that_was_not_wanted_ends_the_connection) {
  RunningServer server;
  // Were the body read as a request, there would be a second answer.
  const std::string inner = std::string("GET /echo/inner HTTP/1.1\r\n") + kEnd;
  const std::string answer = ask(server.port(), "GET /echo/outer HTTP/1.1\r\nHost: x\r\nContent-Length: " +
                                                    std::to_string(inner.size()) + "\r\n\r\n" + inner);
  EXPECT_TRUE(has(answer, "HTTP/1.1 400")) << answer;
  EXPECT_FALSE(has(answer, "inner")) << answer;
}

TEST(HttpServer, ranges_and_compression_are_not_offered) {
  RunningServer server;
  const std::string answer = ask(
      server.port(),
      std::string("GET /echo/word HTTP/1.1\r\nRange: bytes=0-1,1-2\r\nAccept-Encoding: gzip, br\r\n") + kEnd);
  EXPECT_TRUE(has(answer, "HTTP/1.1 200")) << answer;
  EXPECT_TRUE(has(answer, "\r\n\r\nword")) << answer;
}

TEST(HttpServer, an_exception_says_nothing_of_itself) {
  RunningServer server;
  const std::string answer = ask(server.port(), std::string("GET /throw HTTP/1.1\r\n") + kEnd);
  EXPECT_TRUE(has(answer, "HTTP/1.1 500")) << answer;
  EXPECT_FALSE(has(answer, "secret")) << answer;
}

TEST(HttpServer, a_broken_head_is_answered_and_closed) {
  RunningServer server;
  EXPECT_TRUE(has(ask(server.port(), "GET / HTTP/1.1\r\nHost : x\r\n\r\n"), "HTTP/1.1 400"));
  EXPECT_TRUE(has(ask(server.port(), "GET /" + std::string(20'000, 'a')), "HTTP/1.1 414"));
  EXPECT_TRUE(has(ask(server.port(), "GET / HTTP/1.1\r\nA: " + std::string(20'000, 'a')), "HTTP/1.1 431"));
}

TEST(HttpServer, clients_that_trickle_or_say_nothing_hold_no_thread) {
  RunningServer server;  // with four threads
  std::list<Client> slow;
  std::list<Client> silent;
  for (int i = 0; i < 20; ++i) slow.emplace_back(server.port()).send("GET /echo/slow HTTP/1.1\r\nX: ");
  for (int i = 0; i < 20; ++i) silent.emplace_back(server.port());
  EXPECT_TRUE(has(ask(server.port(), std::string("GET /echo/quick HTTP/1.1\r\n") + kEnd), "quick"));
  // They are not forgotten either.
  slow.front().send(std::string("y\r\n") + kEnd);
  EXPECT_TRUE(has(slow.front().read_all(), "slow"));
  silent.front().send(std::string("GET /echo/late HTTP/1.1\r\n") + kEnd);
  EXPECT_TRUE(has(silent.front().read_all(), "late"));
}

TEST(HttpServer, a_full_lobby_gives_up_the_slowest) {
  HttpServerOptions options;
  options.max_waiting_connections = 2;
  RunningServer server(options);
  Client first(server.port());
  first.send("GET /echo/slow HTTP/1.1\r\nX: ");
  std::list<Client> others;
  std::string answer;
  std::thread reader([&] { answer = first.read_all(); });
  for (int i = 0; i < 20; ++i) {
    others.emplace_back(server.port()).send("GET /echo/slow HTTP/1.1\r\nX: ");
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  reader.join();
  EXPECT_TRUE(has(answer, "HTTP/1.1 503")) << answer;
  EXPECT_TRUE(has(ask(server.port(), std::string("GET /echo/quick HTTP/1.1\r\n") + kEnd), "quick"));
}

TEST(HttpServer, a_head_has_its_time) {
  HttpServerOptions options;
  options.connection.head = std::chrono::milliseconds(100);
  RunningServer server(options);
  Client slow(server.port());
  slow.send("GET /echo/slow HTTP/1.1\r\nX: ");
  EXPECT_TRUE(has(slow.read_all(), "HTTP/1.1 400"));
}

TEST(HttpServer, an_idle_connection_is_closed_without_a_word) {
  HttpServerOptions options;
  options.connection.keep_alive = std::chrono::milliseconds(100);
  RunningServer server(options);
  Client silent(server.port());
  EXPECT_EQ(silent.read_all(), "");
}

TEST(HttpServer, without_memory_nothing_but_looking_is_allowed) {
  const MemoryBudget none_left(1);
  HttpServerOptions options;
  options.memory = &none_left;
  RunningServer server(options);
  EXPECT_TRUE(has(ask(server.port(), std::string("GET /echo/word HTTP/1.1\r\n") + kEnd), "HTTP/1.1 200"));
  const std::string post = "POST /echo HTTP/1.1\r\nContent-Type: text/plain\r\nContent-Length: 2\r\n";
  const std::string answer = ask(server.port(), post + kEnd + "hi");
  EXPECT_TRUE(has(answer, "HTTP/1.1 507")) << answer;
  EXPECT_TRUE(has(answer, "memory_full")) << answer;
}

TEST(HttpServer, work_stops_at_the_deadline) {
  HttpServerOptions options;
  options.deadline = std::chrono::milliseconds(100);
  RunningServer server(options);
  EXPECT_TRUE(has(ask(server.port(), std::string("GET /wait HTTP/1.1\r\n") + kEnd), "HTTP/1.1 503"));
  EXPECT_EQ(server.last_reason(), CancelReason::kDeadline);
}

TEST(HttpServer, work_stops_when_the_client_hangs_up) {
  RunningServer server;
  {
    Client client(server.port());
    client.send(std::string("GET /wait HTTP/1.1\r\n") + kEnd);
    while (server.in_flight() == 0) std::this_thread::yield();
  }
  while (server.last_reason() == CancelReason::kNone) std::this_thread::yield();
  EXPECT_EQ(server.last_reason(), CancelReason::kDisconnected);
}

TEST(HttpServer, stopping_cancels_what_does_not_finish) {
  HttpServerOptions options;
  options.drain = std::chrono::milliseconds(50);
  RunningServer server(options);
  Client client(server.port());
  client.send(std::string("GET /wait HTTP/1.1\r\n") + kEnd);
  while (server.in_flight() == 0) std::this_thread::yield();
  server.stop();
  EXPECT_TRUE(has(client.read_all(), "stopped"));
  EXPECT_EQ(server.last_reason(), CancelReason::kShutdown);
}

TEST(HttpServer, a_stream_comes_in_chunks_and_the_connection_lives_on) {
  RunningServer server;
  const std::string answer = ask(server.port(), std::string("GET /ticks HTTP/1.1\r\nHost: x\r\n\r\n") +
                                                    "GET /echo/after HTTP/1.1\r\n" + kEnd);
  EXPECT_TRUE(has(answer, "Transfer-Encoding: chunked")) << answer;
  EXPECT_TRUE(has(answer, "Content-Type: text/event-stream\r\n")) << answer;
  EXPECT_EQ(answer.find("Content-Type"), answer.find("Content-Type: text/event-stream"));
  EXPECT_TRUE(has(answer, "\r\n\r\n5\r\ntick\n\r\n5\r\ntick\n\r\n5\r\ntick\n\r\n0\r\n\r\nHTTP/1.1 200"))
      << answer;
  EXPECT_TRUE(has(answer, "after")) << answer;
}

TEST(HttpServer, a_client_without_chunks_gets_a_stream_that_ends_with_the_connection) {
  RunningServer server;
  const std::string answer = ask(server.port(), "GET /ticks HTTP/1.0\r\n\r\n");
  EXPECT_FALSE(has(answer, "chunked")) << answer;
  EXPECT_TRUE(has(answer, "\r\n\r\ntick\ntick\ntick\n")) << answer;
}

TEST(HttpServer, head_of_a_stream_has_no_body) {
  RunningServer server;
  const std::string answer = ask(server.port(), std::string("HEAD /ticks HTTP/1.1\r\n") + kEnd);
  EXPECT_TRUE(has(answer, "HTTP/1.1 200")) << answer;
  EXPECT_FALSE(has(answer, "tick\n")) << answer;
  EXPECT_EQ(server.streams_ended(), 0);
}

TEST(HttpServer, a_stream_ends_when_its_client_hangs_up) {
  RunningServer server;
  {
    Client client(server.port());
    client.send(std::string("GET /endless HTTP/1.1\r\n") + kEnd);
    while (server.in_flight() == 0) std::this_thread::yield();
  }
  while (server.streams_ended() == 0) std::this_thread::yield();
  while (server.in_flight() > 0) std::this_thread::yield();
}

TEST(HttpServer, a_stream_is_cut_when_nobody_reads_it) {
  HttpServerOptions options;
  options.connection.stall = std::chrono::milliseconds(100);
  RunningServer server(options);
  Client client(server.port());
  client.send(std::string("GET /endless HTTP/1.1\r\n") + kEnd);
  while (server.streams_ended() == 0) std::this_thread::yield();
  EXPECT_EQ(server.last_reason(), CancelReason::kNone) << "the write's deadline ended it";
}

TEST(HttpServer, a_stream_outlives_the_deadline_of_requests_and_ends_with_the_server) {
  HttpServerOptions options;
  options.deadline = std::chrono::milliseconds(1);
  options.drain = std::chrono::milliseconds(200);
  RunningServer server(options);
  Client client(server.port());
  client.send(std::string("GET /endless HTTP/1.1\r\n") + kEnd);
  std::thread reader([&] { (void)client.read_all(); });
  while (server.streams_started() == 0) std::this_thread::yield();
  server.stop();
  reader.join();
  EXPECT_EQ(server.last_reason(), CancelReason::kShutdown);
}

TEST(HttpServer, a_stop_that_comes_before_serving_is_not_lost) {
  HttpServerOptions options;
  options.port = 0;
  HttpServer server(Router(), options, [](const RequestRecord&) {});
  ASSERT_TRUE(server.bind());
  server.stop();
  server.serve();  // returns
}

TEST(HttpServer, a_port_in_use_is_an_error) {
  RunningServer server;
  HttpServerOptions options;
  options.port = server.port();
  HttpServer second(Router(), options, [](const RequestRecord&) {});
  const auto port = second.bind();
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, ErrorCode::kIo);
}

}  // namespace
}  // namespace gridcast::server
