#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "core/error.h"
#include "proto/limits.h"
#include "server/http/connection.h"
#include "server/http/http_types.h"
#include "server/http/router.h"

namespace gridcast::server {

namespace access {
class AccessControl;
}
class MemoryBudget;

struct HttpServerOptions {
  std::string host = "127.0.0.1";
  int port = 8080;                           ///< 0: any free one
  std::size_t connection_threads = 64;       ///< connections served at once
  std::size_t max_queued_connections = 256;  ///< whose request has come; beyond: 503 at once
  /// That have not sent one; beyond, who waits longest is closed.
  std::size_t max_waiting_connections = 512;
  /// Questions about many rays, at work or waiting for it, that are never too many; beyond, 503 when they
  /// would take longer than `heavy_wait`.
  std::size_t heavy_requests = proto::default_heavy_requests();
  std::chrono::milliseconds heavy_wait{20};
  /// Uploads and pictures, which keep a thread for long, at once; beyond, 503.
  std::size_t long_requests = proto::Limits{}.long_requests;
  std::size_t connections_per_address = 0;  ///< at once; 0: no limit
  /// Bodies held in memory at once, all requests together; beyond: 503.
  std::size_t max_body_bytes_in_flight = std::size_t(2) << 30;
  std::chrono::milliseconds deadline{30'000};  ///< of a request's work, the wait in the queue included
  std::chrono::milliseconds drain{5'000};  ///< how long stop() lets requests finish before cancelling them
  /// And then lets clients read their answers, whose connections are cut after it.
  std::chrono::milliseconds last_answers{10'000};
  ConnectionLimits connection;
  const access::AccessControl* access = nullptr;  ///< null: whoever reaches the port may do everything
  const MemoryBudget* memory = nullptr;           ///< null: none
};

/// One answered request, for logs and metrics. No text of the client's but the method.
struct RequestRecord {
  std::string method;
  std::string route;  ///< the pattern; empty when none matched
  int status = 0;
  double ms = 0.0;
  std::size_t bytes_in = 0;
  std::size_t bytes_out = 0;
  std::string request_id;
  std::string caller = {};  ///< the name of its token; empty without one

  /// One that no thread was woken for.
  [[nodiscard]] bool is_refusal() const { return method.empty() && status == 503; }
};
using RequestObserver = std::function<void(const RequestRecord&)>;

/// The edge: sockets and HTTP in front of a Router. What a request may cost (head, body, time, connections)
/// is bounded here, before any route sees it.
class HttpServer {
 public:
  HttpServer(Router router, HttpServerOptions options, RequestObserver observer);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Binds and listens; the port in use. kIo when the address cannot be had.
  [[nodiscard]] Result<int> bind();
  /// Serves until stop(); then returns when every request has been answered or cancelled.
  void serve();
  /// From any thread: no new connections; requests at work get options.drain to finish,
  /// their answers options.last_answers to be read.
  void stop();

  [[nodiscard]] std::size_t requests_in_flight() const;

 private:
  class Edge;
  std::unique_ptr<Edge> edge_;
};

}  // namespace gridcast::server
