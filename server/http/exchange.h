#pragma once

#include <atomic>
#include <cstddef>
#include <optional>
#include <string>
#include <variant>

#include "proto/error_table.h"
#include "server/http/connection.h"
#include "server/http/heavy_load.h"
#include "server/http/http_server.h"
#include "server/http/incoming_body.h"
#include "server/http/request_watch.h"
#include "server/http/router.h"
#include "server/http/under_way.h"

namespace gridcast::server {

/// What all requests of a server share.
struct ExchangeShared {
  const Router& router;
  const HttpServerOptions& options;
  RequestWatch& watch;
  std::atomic<std::size_t>& body_bytes_in_flight;
  UnderWay& under_way;
  HeavyLoad& heavy;
};

/// One request and its answer: checks before the body, the body, the route's handler.
class Exchange {
 public:
  /// `place` is that of a heavy request, where it has one already; it is given up as soon as the work is
  /// done.
  Exchange(ExchangeShared shared, Connection& connection, const HttpHead& head,
           std::optional<HeavyLoad::Place>& place)
      : shared_(shared),
        connection_(connection),
        head_(head),
        place_(place),
        under_way_(shared.under_way, connection.socket()) {}
  ~Exchange() = default;
  Exchange(const Exchange&) = delete;
  Exchange& operator=(const Exchange&) = delete;

  /// Never throws; what goes wrong becomes a problem.
  [[nodiscard]] HttpResponse run();
  /// The body of an answer that run() gave a stream, sent by `write`.
  void stream(const StreamBody& body, const WritePart& write);

  /// False for a client that does not know chunks (HTTP/1.0): a stream ends with its connection.
  [[nodiscard]] bool knows_chunks() const { return head_.minor_version > 0; }
  [[nodiscard]] const RequestRecord& record() const { return record_; }
  /// After run(): true when the body was not read whole, so the connection cannot be used again.
  [[nodiscard]] bool must_close() const { return must_close_; }
  /// After run(): the client is gone, there is no one to answer.
  [[nodiscard]] bool client_gone() const { return client_gone_; }

 private:
  [[nodiscard]] HttpResponse answer();
  [[nodiscard]] std::optional<proto::Problem> prepare(HttpRequest& request, const Route*& route);
  /// Before the body is read: whose request it is, or why it may not be. `route` is null for an unknown path.
  [[nodiscard]] std::optional<proto::Problem> admit(HttpRequest& request, const Route* route);
  [[nodiscard]] std::variant<std::size_t, proto::Problem> body_limit(const Route& route,
                                                                     const HttpRequest& request) const;
  /// Why the server has no memory for a request, if so.
  [[nodiscard]] std::optional<proto::Problem> check_memory(const Route& route, std::size_t body_bytes) const;
  /// Sets `bytes` of memory aside for the body, or says why that cannot be.
  [[nodiscard]] std::optional<proto::Problem> reserve(const Route& route, std::size_t bytes);
  [[nodiscard]] std::optional<proto::Problem> read_body(const Route& route, HttpRequest& request);
  [[nodiscard]] std::variant<std::string, BodyError> read_zstd(const Route& route, std::size_t max_bytes);
  /// Or refuses what would be too much at once.
  [[nodiscard]] HttpResponse admit_and_handle(const Route& route, HttpRequest& request);
  [[nodiscard]] HttpResponse handle(const Route& route, HttpRequest& request);
  /// What an error of the body is for its client; notes when there is none left.
  [[nodiscard]] proto::Problem body_problem(BodyError error);
  /// Whether the handler reads the body by itself.
  [[nodiscard]] bool comes_in_pieces(const Route& route, const HttpRequest& request) const;

  ExchangeShared shared_;
  Connection& connection_;
  const HttpHead& head_;
  std::optional<HeavyLoad::Place>& place_;
  const UnderWay::Guard under_way_;
  const Clock::time_point started_ = connection_.waits_since();
  Clock::duration transfer_{};  ///< spent on reading the body, which has its own deadline
  RequestRecord record_;
  std::string allowed_;
  std::size_t reserved_bytes_ = 0;
  std::optional<Cancellation> cancellation_;  ///< while a handler or a stream is at work
  std::optional<RequestWatch::Guard> guard_;
  std::size_t incoming_bytes_ = 0;  ///< of a body that the handler reads by itself
  bool must_close_ = false;
  bool client_gone_ = false;
};

}  // namespace gridcast::server
