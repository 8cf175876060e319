// Bodies that are read while their work is under way.

#include "tests/unit/server/http/few_threads.h"

namespace gridcast::server {
namespace {

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
  slow.send("x").send(get("/other"));
  answer = slow.read_all();
  EXPECT_TRUE(has(answer, "5000000 in time")) << answer;
}

TEST(Pieces, a_client_that_goes_ends_the_work) {
  FewThreads server(100);
  { Client(server.port()).send(pieces_head() + std::string(1'000'000, 'x')); }
  for (int i = 0; i < 10'000 && server.in_flight() > 0; ++i) std::this_thread::sleep_for(milliseconds(1));
  EXPECT_EQ(server.in_flight(), 0U);
}

TEST(PackedBodies, their_windows_count_among_the_bodies) {
  FewThreads server(100, 1000, std::size_t(1) << 20);
  // A zstd frame of a window of 1 KiB or of 8 MiB, and "hello" as it is in its one block.
  for (const auto& [window, status] : {std::pair('\0', " 200 "), std::pair('\x68', " 503 ")}) {
    std::string frame("\x28\xB5\x2F\xFD\0", 5);
    frame.push_back(window);
    frame.append("\x29\0\0hello", 8);
    const std::string answer =
        Client(server.port())
            .send(
                "POST /v1/scenes/a/rays/any HTTP/1.1\r\nHost: x\r\nConnection: close\r\n"
                "Content-Type: text/plain\r\nContent-Encoding: zstd\r\nContent-Length: " +
                std::to_string(frame.size()) + "\r\n\r\n" + frame)
            .read_all();
    EXPECT_TRUE(has(answer, status)) << answer;
  }
}

}  // namespace
}  // namespace gridcast::server
