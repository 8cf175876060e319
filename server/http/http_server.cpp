// The one file that knows cpp-httplib. Debian's 0.11.4 has known weaknesses in reading requests (unbounded
// lines and header counts, decompression, ranges, chunk sizes): here it binds the port and writes answers,
// and everything it reads was read, checked and rewritten by Connection before.

#include "server/http/http_server.h"

#include <algorithm>
#include <mutex>
#include <thread>
#include <utility>

#include <httplib.h>
#include <sys/socket.h>

#include "server/http/accept_loop.h"
#include "server/http/address_limit.h"
#include "server/http/admission.h"
#include "server/http/exchange.h"
#include "server/http/lobby.h"
#include "server/http/refusals.h"
#include "server/http/small_request.h"
#include "server/http/under_way.h"
#include "server/http/worker_pool.h"

namespace gridcast::server {
namespace {

// A busy client's next request comes sooner than the way through the lobby takes.
constexpr std::chrono::milliseconds kLinger{1};
// For small requests while all other threads have theirs: probes, and a few rays beside large batches.
constexpr std::size_t kReservedThreads = 2;
constexpr std::size_t kMaxQueuedSmall = 64;
// Clients that come while the accepting thread waits for a core; the system may hold it to less
// (net.core.somaxconn). Who finds no place there tries again after a whole second.
constexpr int kBacklog = 4096;

/// A head for the library to read, whose answer goes nowhere.
class HeadStream : public httplib::Stream {
 public:
  explicit HeadStream(std::string head) : head_(std::move(head)) {}

  [[nodiscard]] bool is_readable() const override { return at_ < head_.size(); }
  [[nodiscard]] bool is_writable() const override { return true; }
  ssize_t read(char* to, std::size_t size) override {
    const std::size_t n = head_.copy(to, size, at_);
    at_ += n;
    return ssize_t(n);
  }
  ssize_t write(const char* /*from*/, std::size_t size) override { return ssize_t(size); }
  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  // The library compares this with FD_SETSIZE for its select(), which is not used here.
  [[nodiscard]] socket_t socket() const override { return INVALID_SOCKET; }

 private:
  std::string head_;
  std::size_t at_ = 0;
};

/// A head that was checked and reduced to what the library needs. What it writes goes out.
class GuardStream final : public HeadStream {
 public:
  GuardStream(Connection& connection, std::string head)
      : HeadStream(std::move(head)), connection_(connection) {}

  [[nodiscard]] bool is_writable() const override { return !failed_; }
  ssize_t write(const char* from, std::size_t size) override {
    failed_ = failed_ || !connection_.write({from, size});
    return failed_ ? -1 : ssize_t(size);
  }
  [[nodiscard]] bool failed() const { return failed_; }

 private:
  Connection& connection_;
  bool failed_ = false;
};

// The library hands no context from a connection to a request; both run on the same thread.
thread_local Exchange* current_exchange = nullptr;
thread_local bool must_close_after = false;

}  // namespace

class HttpServer::Edge final : public httplib::Server {
 public:
  Edge(Router router, HttpServerOptions options, RequestObserver observer)
      : router_(std::move(router)),
        options_(std::move(options)),
        observer_(std::move(observer)),
        watch_(options_.memory),
        admission_(options_.heavy_requests, options_.heavy_wait, options_.long_requests),
        addresses_(options_.connections_per_address),
        pool_(options_.connection_threads, options_.max_queued_connections),
        reserved_(kReservedThreads, kMaxQueuedSmall),
        lobby_(options_.max_waiting_connections, exits()) {
    // Without SO_REUSEPORT, which the library sets by default and which lets two servers share a port unseen.
    set_socket_options([](socket_t sock) {
      const int yes = 1;
      ::setsockopt(sock, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    set_tcp_nodelay(true);
    set_keep_alive_timeout(options_.connection.keep_alive.count() / 1000);
    set_keep_alive_max_count(options_.connection.requests);
    set_pre_routing_handler([](const httplib::Request&, httplib::Response& response) {
      fill(response);
      return HandlerResponse::Handled;
    });
    // The library makes a table of methods at its first request: here, before there are threads.
    HeadStream none("NONE / HTTP/1.1\r\n\r\n");
    bool closed = false;
    process_request(none, true, closed, nullptr);
  }

  ~Edge() override {
    end_serving();
    if (const socket_t listening = svr_sock_.exchange(INVALID_SOCKET); listening != INVALID_SOCKET)
      ::close(listening);
  }
  Edge(const Edge&) = delete;
  Edge& operator=(const Edge&) = delete;

  Result<int> bind() {
    const int port = options_.port == 0 ? bind_to_any_port(options_.host)
                                        : (bind_to_port(options_.host, options_.port) ? options_.port : -1);
    if (port <= 0)
      return Error{ErrorCode::kIo, "cannot listen on " + options_.host + ":" + std::to_string(options_.port),
                   ""};
    // The library listens with a backlog of 5: too short for a burst of clients.
    ::listen(svr_sock_, kBacklog);
    return port;
  }

  /// In place of the library's own loop, which makes four system calls of an accept. Answers what has come
  /// before it returns.
  void serve() {
    serving_ = true;
    accept_connections(svr_sock_, stopping_, [this](int socket) { return welcome(socket); });
    end_serving();
  }

  void stop_serving() {
    const std::lock_guard lock(stop_mutex_);
    if (stopping_.exchange(true)) return;
    // Closed later: the library cuts the answers under way of a server without a socket.
    if (const socket_t listening = svr_sock_; listening != INVALID_SOCKET) ::shutdown(listening, SHUT_RDWR);
    drain_ = std::thread([this] {
      wait_until_served(options_.drain);
      watch_.shut_down();
      under_way_.end_receiving();
      wait_until_served(options_.last_answers);
      under_way_.end_sending();
    });
  }

  void join_drain() {
    std::thread drain = [this] {
      const std::lock_guard lock(stop_mutex_);
      return std::move(drain_);
    }();
    if (drain.joinable()) drain.join();
  }

  [[nodiscard]] std::size_t in_flight() const { return under_way_.count(); }

 private:
  /// Called by the library for a request whose head it has just read from a GuardStream.
  static void fill(httplib::Response& response) {
    HttpResponse answer = current_exchange->run();
    response.status = answer.status;
    // The library names a stream's type by itself.
    if (!answer.content_type.empty() && !answer.stream && answer.in_parts.parts.empty())
      response.set_header("Content-Type", answer.content_type);
    for (const auto& [name, value] : answer.headers) response.set_header(name, value);
    response.body = std::move(answer.body);
    if (answer.stream) stream(response, answer);
    if (!answer.in_parts.parts.empty()) send_parts(response, answer);
    if (current_exchange->must_close()) must_close_after = true;
    if (must_close_after) response.set_header("Connection", "close");
  }

  static void send_parts(httplib::Response& response, const HttpResponse& answer) {
    response.set_content_provider(
        answer.in_parts.bytes(), answer.content_type,
        [body = answer.in_parts](std::size_t, std::size_t, httplib::DataSink& sink) {
          for (const auto& part : body.parts)
            if (!sink.write(reinterpret_cast<const char*>(part.data()), part.size())) return false;
          return true;
        });
  }

  /// The whole stream is one call of the library's provider, so the library never cuts it in two.
  static void stream(httplib::Response& response, const HttpResponse& answer) {
    const auto provide = [exchange = current_exchange, body = answer.stream](std::size_t,
                                                                             httplib::DataSink& sink) {
      exchange->stream(body, [&sink](std::string_view part) { return sink.write(part.data(), part.size()); });
      sink.done();
      return true;
    };
    if (current_exchange->knows_chunks()) {
      response.set_chunked_content_provider(answer.content_type, provide);
    } else {
      response.set_content_provider(answer.content_type, provide);
      must_close_after = true;
    }
  }

  /// Answers what has come; returns when every thread is done.
  void end_serving() {
    lobby_.close();
    pool_.shut_down();
    reserved_.shut_down();
    serving_ = false;
  }

  void wait_until_served(std::chrono::milliseconds at_most) const {
    const Clock::time_point until = Clock::now() + at_most;
    while (serving_ && Clock::now() < until) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }

  /// Whether it was refused.
  bool welcome(int socket) {
    auto place = addresses_.try_take(socket);
    if (!place) {
      const auto stranger = std::make_shared<Connection>(socket, options_.connection);
      refusals_.refuse_stranger(*stranger);
      lobby_.enter(stranger);
      return true;
    }
    const auto connection = make_guest(std::move(*place), socket, options_.connection);
    // Often the request has come by now, and more so the busier we are.
    if (connection->look() == Arrived::kHead) return !dispatch(connection, connection->take_head());
    lobby_.enter(connection);
    return false;
  }

  Lobby::Exits exits() {
    const auto say = [this](proto::ProblemCode code, const char* detail) {
      return [this, problem = proto::Problem{code, detail, ""}](const Connection& connection) {
        refusals_.turn_away(connection, problem);
      };
    };
    return {[this](Connection& connection) { return refuse_in_lobby(connection); },
            [this](const std::shared_ptr<Connection>& connection) {
              dispatch(connection, connection->take_head());
            },
            say(proto::ProblemCode::kInvalidRequest, "the head came too slowly"),
            say(proto::ProblemCode::kOverloaded, "too many connections")};
  }

  enum class Lane : std::uint8_t { kAny, kSmall };

  /// To a thread that serves `head`, or not: then false. Small requests go ahead of others where no thread is
  /// free.
  bool dispatch(const std::shared_ptr<Connection>& connection, TakenHead head) {
    const auto turn = std::make_shared<Turn>(Turn{std::move(head)});
    bool has_refused = false;
    while (!admission_.admit(*connection, *turn)) {
      const auto left = refusals_.refuse(*connection, std::get_if<HttpHead>(&*turn->head));
      has_refused = true;
      if (left == Refusals::Left::kNothing) return false;
      turn->head = left == Refusals::Left::kOpen ? connection->take_head() : std::nullopt;
    }
    if (!turn->head) {
      lobby_.enter(connection);
      return !has_refused;
    }
    const auto* request = std::get_if<HttpHead>(&*turn->head);
    const bool is_small = request != nullptr && is_small_request(*request);
    const auto task_on = [&](Lane lane) -> std::function<void()> {
      return [this, connection, turn, lane] { serve_connection(connection, std::move(*turn), lane); };
    };
    std::function<void()> task = task_on(Lane::kAny);
    if (pool_.try_hand_over(task)) return true;
    std::function<void()> small = task_on(Lane::kSmall);
    if (is_small && reserved_.try_enqueue(small)) return true;
    if (pool_.try_enqueue(task)) return true;
    if (refusals_.refuse(*connection, nullptr) == Refusals::Left::kDraining) lobby_.enter(connection);
    return false;
  }

  /// Who asks for too much waits where it is, and no thread is woken.
  Lobby::Then refuse_in_lobby(Connection& connection) {
    while (const auto* head = admission_.heavy().is_full() ? connection.peek_head() : nullptr) {
      const auto* request = std::get_if<HttpHead>(head);
      if (request == nullptr || !is_heavy_request(*request)) break;
      const TakenHead taken = connection.take_head();
      const auto left = refusals_.refuse(connection, std::get_if<HttpHead>(&*taken));
      if (left == Refusals::Left::kNothing) return Lobby::Then::kEnds;
      if (left == Refusals::Left::kDraining || !connection.has_head()) return Lobby::Then::kStays;
    }
    return Lobby::Then::kLeaves;
  }

  /// Serves `head`, and what follows it at once; then the connection waits in the lobby. Where others wait
  /// for the thread, what follows takes its turn behind them.
  void serve_connection(const std::shared_ptr<Connection>& connection, Turn turn, Lane lane) {
    TakenHead& head = turn.head;
    while (head && !connection->closing()) {
      if (const auto* error = std::get_if<HeadError>(&*head)) {
        refusals_.answer(*connection, *error);
        break;
      }
      if (!admission_.admit(*connection, turn)) {
        dispatch(connection, std::move(head));
        return;
      }
      must_close_after = connection->is_used_up();
      const bool goes_well = serve_request(*connection, std::get<HttpHead>(*head), turn.place);
      turn.place.reset();
      turn.long_place.reset();
      if (!goes_well) return;
      if (connection->closing()) break;
      connection->begin_wait();
      const bool goes_on = lane == Lane::kAny && !pool_.is_behind();
      const Arrived next = goes_on ? connection->look_within(kLinger) : connection->look();
      head = next == Arrived::kHead ? connection->take_head() : std::nullopt;
      if (head && !goes_on) {
        dispatch(connection, std::move(head));
        return;
      }
    }
    lobby_.enter(connection);
  }

  /// False when the connection is of no more use.
  bool serve_request(Connection& connection, const HttpHead& head, std::optional<HeavyLoad::Place>& place) {
    Exchange exchange({router_, options_, watch_, body_bytes_, under_way_, admission_.heavy()}, connection,
                      head, place);
    current_exchange = &exchange;
    must_close_after = must_close_after || head.wants_close() || stopping_;
    // Only what the library needs to answer: no Range, Expect, Accept-Encoding, Content-* or chunked coding.
    GuardStream stream(connection, head.method + " / HTTP/1.1\r\n\r\n");
    bool closed = false;
    process_request(stream, must_close_after, closed, nullptr);
    current_exchange = nullptr;
    observer_(exchange.record());
    if (stream.failed() || exchange.client_gone()) return false;
    if (exchange.must_close()) connection.begin_close();
    return exchange.must_close() || !must_close_after;
  }

  Router router_;
  HttpServerOptions options_;
  RequestObserver observer_;
  RequestWatch watch_;
  std::atomic<std::size_t> body_bytes_{0};
  UnderWay under_way_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> serving_{false};  ///< until the last connection has been left
  std::mutex stop_mutex_;             ///< guards drain_
  std::thread drain_;
  Admission admission_;
  AddressLimit addresses_;
  const Refusals refusals_{observer_, stopping_};
  WorkerPool pool_, reserved_;
  Lobby lobby_;  // last: it hands to the rest
};

HttpServer::HttpServer(Router router, HttpServerOptions options, RequestObserver observer)
    : edge_(std::make_unique<Edge>(std::move(router), std::move(options), std::move(observer))) {}

HttpServer::~HttpServer() {
  stop();
  edge_->join_drain();
}

Result<int> HttpServer::bind() {
  return edge_->bind();
}

void HttpServer::serve() {
  edge_->serve();
  edge_->join_drain();
}

void HttpServer::stop() {
  edge_->stop_serving();
}

std::size_t HttpServer::requests_in_flight() const {
  return edge_->in_flight();
}

}  // namespace gridcast::server
