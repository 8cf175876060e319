#pragma once
// A server with two threads and requests that keep them.

#include <algorithm>
#include <atomic>
#include <list>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "server/http/http_server.h"
#include "tests/unit/server/http/raw_client.h"

namespace gridcast::server {

using std::chrono::milliseconds;

/// Two threads, and requests that keep them as long as a test wants.
class FewThreads {
 public:
  /// `heavy`: so many heavy requests at once, and no more.
  explicit FewThreads(std::size_t queued, std::size_t heavy = 1000,
                      std::size_t body_bytes = std::size_t(1) << 30)
      : FewThreads(options(queued, heavy, body_bytes)) {}
  explicit FewThreads(HttpServerOptions options)
      : server_(routes(), std::move(options), [](const RequestRecord&) {}) {
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

  static HttpServerOptions options(std::size_t queued, std::size_t heavy = 1000,
                                   std::size_t body_bytes = std::size_t(1) << 30) {
    HttpServerOptions made;
    made.port = 0;
    made.connection_threads = 2;
    made.max_queued_connections = queued;
    made.heavy_requests = heavy;
    made.max_body_bytes_in_flight = body_bytes;
    made.heavy_wait = milliseconds(-1);
    made.deadline = std::chrono::seconds(20);
    return made;
  }

 private:
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
    router.add({"POST", "/v1/scenes/{s}/renders", {{"text/plain", 100}}, when(release_)});
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

/// What a server has let go of it notices a moment later: asks again as long as it refuses, for 20 s.
inline std::string ask_until_served(int port, const std::string& text) {
  const Clock::time_point end = Clock::now() + std::chrono::seconds(20);
  std::string answer = ask(port, text);
  while (answer.starts_with("HTTP/1.1 503") && Clock::now() < end) answer = ask(port, text);
  return answer;
}

/// A heavy request whose body comes with it.
inline std::string ask_sensor(const std::string& more = "") {
  return "POST /v1/scenes/a/sensors HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: "
         "2\r\n" +
         more + "\r\nhi";
}
inline std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != text.npos; at = text.find(part, at + 1)) ++found;
  return found;
}

}  // namespace gridcast::server
