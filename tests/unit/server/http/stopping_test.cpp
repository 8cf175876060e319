// A server that stops waits for work and answers, and not for ever for clients.

#include <array>
#include <atomic>
#include <thread>

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/http/http_server.h"
#include "server/http/under_way.h"
#include "tests/unit/server/http/raw_client.h"

namespace gridcast::server {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kLarge = std::size_t(64) << 20;  // more than sockets hold

/// Takes bodies whole and in pieces, and gives answers that have to be read.
class StoppingServer {
 public:
  explicit StoppingServer(milliseconds drain, milliseconds last_answers)
      : server_(routes(), options(drain, last_answers), [](const RequestRecord&) {}) {
    port_ = server_.bind().value();
    thread_ = std::thread([this] { server_.serve(); });
  }
  ~StoppingServer() { stop(); }
  StoppingServer(const StoppingServer&) = delete;
  StoppingServer& operator=(const StoppingServer&) = delete;

  /// Returns when it has ended.
  void stop() {
    begin_stop();
    if (thread_.joinable()) thread_.join();
  }
  void begin_stop() { server_.stop(); }
  /// A client whose request is under way.
  void wait_for_request() const {
    while (server_.requests_in_flight() == 0) std::this_thread::yield();
  }
  [[nodiscard]] int port() const { return port_; }

 private:
  static HttpServerOptions options(milliseconds drain, milliseconds last_answers) {
    HttpServerOptions made;
    made.port = 0;
    made.connection_threads = 4;
    made.drain = drain;
    made.last_answers = last_answers;
    // Longer than any test: what ends is ended by the server's stop.
    made.connection.stall = std::chrono::minutes(10);
    return made;
  }
  static HttpResponse take_pieces(const HttpRequest& request) {
    std::string piece(100'000, ' ');
    while (request.incoming != nullptr && request.incoming->bytes_left() > 0) {
      piece.resize(std::min(piece.size(), request.incoming->bytes_left()));
      if (const auto problem = request.incoming->read(piece, [] {}))
        return {problem->status(), "text/plain", problem->detail, {}};
    }
    return {200, "text/plain", "whole", {}};
  }
  static Router routes() {
    Router router;
    router.add({"GET", "/large", {}, [](const HttpRequest&, Cancellation&) {
                  return HttpResponse{200, "text/plain", std::string(kLarge, 'x'), {}};
                }});
    router.add({"POST", "/whole", {{"text/plain", 1000}}, [](const HttpRequest& request, Cancellation&) {
                  return HttpResponse{200, "text/plain", request.body, {}};
                }});
    router.add({"POST",
                "/v1/scenes/{s}/rays/any",
                {{"text/plain", std::size_t(8) << 20}},
                [](const HttpRequest& request, Cancellation&) { return take_pieces(request); },
                BodyArrival::kOnTheWay});
    return router;
  }

  HttpServer server_;
  int port_ = 0;
  std::thread thread_;
};

std::string post(const std::string& path, std::size_t bytes) {
  return "POST " + path +
         " HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: " + std::to_string(bytes) +
         "\r\n\r\n";
}

TEST(Stopping, who_has_not_sent_a_whole_body_is_told_and_left) {
  StoppingServer server(milliseconds(50), milliseconds(20'000));
  Client whole(server.port()), pieces(server.port());
  whole.send(post("/whole", 900) + "begun");
  server.wait_for_request();
  pieces.send(post("/v1/scenes/a/rays/any", 5'000'000) + std::string(300'000, 'x'));
  std::this_thread::sleep_for(milliseconds(20));
  server.stop();
  for (Client* client : {&whole, &pieces}) {
    const std::string answer = client->read_all();
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 503")) << answer;
    EXPECT_TRUE(has(answer, "shutting down")) << answer;
  }
}

TEST(Stopping, an_answer_that_is_read_slowly_comes_whole_within_its_time) {
  StoppingServer server(milliseconds(20), milliseconds(20'000));
  Client client(server.port());
  client.send(get("/large"));
  server.wait_for_request();
  server.begin_stop();
  std::this_thread::sleep_for(milliseconds(200));
  const std::string answer = client.read_all();
  server.stop();
  EXPECT_GE(answer.size(), kLarge);
  EXPECT_FALSE(answer.ends_with("cut"));
}

TEST(Stopping, an_answer_that_nobody_reads_is_given_up) {
  StoppingServer server(milliseconds(20), milliseconds(50));
  Client client(server.port());
  client.send(get("/large"));
  server.wait_for_request();
  server.stop();
  EXPECT_LT(client.read_all().size(), kLarge);
}

class UnderWaySockets : public testing::Test {
 protected:
  UnderWaySockets() { EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends_.data()), 0); }
  ~UnderWaySockets() override {
    for (const int end : ends_) ::close(end);
  }
  [[nodiscard]] int server() const { return ends_[0]; }
  /// What a server's read of its end gives: -1 when there is nothing yet.
  [[nodiscard]] ssize_t received() const {
    char letter = 0;
    return ::recv(server(), &letter, 1, MSG_DONTWAIT);
  }
  [[nodiscard]] bool can_send() const { return ::send(server(), "x", 1, MSG_NOSIGNAL | MSG_DONTWAIT) == 1; }

  UnderWay all_;
  std::array<int, 2> ends_{};
};

TEST_F(UnderWaySockets, are_counted_and_end_step_by_step) {
  const UnderWay::Guard guard(all_, server());
  EXPECT_EQ(all_.count(), 1U);
  EXPECT_EQ(received(), -1);
  all_.end_receiving();
  EXPECT_TRUE(all_.has_ended_receiving());
  EXPECT_EQ(received(), 0);
  EXPECT_TRUE(can_send());
  all_.end_sending();
  EXPECT_FALSE(can_send());
}

TEST_F(UnderWaySockets, that_come_later_are_treated_alike) {
  all_.end_receiving();
  const UnderWay::Guard guard(all_, server());
  EXPECT_EQ(received(), 0);
  EXPECT_TRUE(can_send());
}

TEST_F(UnderWaySockets, that_have_left_are_left_alone) {
  { const UnderWay::Guard guard(all_, server()); }
  EXPECT_EQ(all_.count(), 0U);
  all_.end_sending();
  EXPECT_TRUE(can_send());
}

}  // namespace
}  // namespace gridcast::server
