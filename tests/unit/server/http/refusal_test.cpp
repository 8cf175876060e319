// What a refusal leaves of a connection.

#include "tests/unit/server/http/few_threads.h"

namespace gridcast::server {
namespace {

TEST(Refusal, a_connection_whose_whole_request_came_goes_on) {
  FewThreads server(100, 1);
  Client held(server.port());
  held.send(ask_sensor("Connection: close\r\n"));
  while (server.started() < 1) std::this_thread::yield();
  Client client(server.port());
  const std::string answers =
      client.send(ask_sensor() + ask_sensor() + get("/healthz/live", "") + ask_sensor() + get("/other"))
          .read_all();
  EXPECT_EQ(count(answers, "HTTP/1.1 503"), 3U) << answers;
  EXPECT_EQ(count(answers, "Retry-After: "), 3U) << answers;
  EXPECT_EQ(count(answers, "HTTP/1.1 200"), 2U) << answers;
  EXPECT_LT(answers.find("live"), answers.find("other")) << answers;
  EXPECT_EQ(server.in_flight(), 1U);
  server.release();
  EXPECT_TRUE(has(held.read_all(), "came"));
}

TEST(Refusal, a_connection_goes_on_however_often_it_is_refused) {
  FewThreads server(100, 1);
  Client held(server.port());
  held.send(ask_sensor("Connection: close\r\n"));
  while (server.started() < 1) std::this_thread::yield();
  Client client(server.port());
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(has(client.send(ask_sensor()).read_answer(), "HTTP/1.1 503")) << i;
    EXPECT_TRUE(has(client.send(get("/healthz/live", "")).read_answer(), "live")) << i;
    // Two at a time, when no thread lingers for them: the second lies in the buffer when the first is
    // refused.
    std::this_thread::sleep_for(milliseconds(20));
    client.send(ask_sensor() + ask_sensor());
    EXPECT_TRUE(has(client.read_answer(), "HTTP/1.1 503") && has(client.read_answer(), "HTTP/1.1 503")) << i;
  }
  server.release();
  EXPECT_TRUE(has(held.read_all(), "came"));
  EXPECT_TRUE(has(client.send(ask_sensor()).read_answer(), "came")) << "and is served when there is room";
}

TEST(Refusal, a_malformed_head_is_told_apart_while_others_are_refused) {
  FewThreads server(100, 1);
  Client held(server.port());
  held.send(ask_sensor("Connection: close\r\n"));
  while (server.started() < 1) std::this_thread::yield();
  Client client(server.port());
  EXPECT_TRUE(has(client.send(ask_sensor()).read_answer(), "HTTP/1.1 503"));
  EXPECT_TRUE(has(client.send("GET / HTTP/1.1\r\nHost : x\r\n\r\n").read_all(), "HTTP/1.1 400"));
}

TEST(Refusal, pictures_and_uploads_leave_threads_to_others) {
  HttpServerOptions options = FewThreads::options(100);
  options.long_requests = 1;
  FewThreads server(options);
  std::string render = ask_sensor("Connection: close\r\n");
  render.replace(render.find("sensors"), 7, "renders");
  std::string begun = render;
  begun.pop_back();
  // It counts from its head on: a slow sender keeps a thread, too.
  Client slow(server.port());
  slow.send(begun);
  while (server.in_flight() < 1) std::this_thread::yield();
  for (int i = 0; i < 5; ++i) {
    const std::string answer = Client(server.port()).send(render).read_all();
    EXPECT_TRUE(has(answer, "HTTP/1.1 503") && has(answer, "Retry-After: ")) << answer;
    EXPECT_TRUE(has(Client(server.port()).send(get("/other")).read_all(), "other")) << i;
  }
  server.release();
  EXPECT_TRUE(has(slow.send(render.substr(render.size() - 1)).read_all(), "came"));
  EXPECT_TRUE(has(ask_until_served(server.port(), render), "came"));
}

TEST(Refusal, it_needs_no_thread) {
  FewThreads server(100, 1);
  Client held(server.port()), other(server.port());
  held.send(ask_sensor("Connection: close\r\n"));
  other.send(get("/hold"));
  while (server.started() < 2) std::this_thread::yield();
  // A thread would come to it after the server has been let go.
  for (int i = 0; i < 5; ++i) {
    const std::string answer = Client(server.port()).send(ask_sensor("Connection: close\r\n")).read_all();
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 503") && answer.ends_with("}"))
        << "whole, and not cut: " << answer;
  }
  EXPECT_EQ(server.in_flight(), 2U);
  server.release();
  EXPECT_TRUE(has(held.read_all(), "came"));
}

TEST(Refusal, a_last_request_or_one_that_is_still_sent_ends_its_connection) {
  FewThreads server(100, 1);
  Client held(server.port());
  held.send(ask_sensor("Connection: close\r\n"));
  while (server.started() < 1) std::this_thread::yield();
  std::string answers =
      Client(server.port()).send(ask_sensor("Connection: close\r\n") + get("/other")).read_all();
  EXPECT_EQ(count(answers, "HTTP/1.1"), 1U) << answers;
  EXPECT_TRUE(has(answers, "503") && has(answers, "Connection: close")) << answers;
  const std::string large =
      "POST /v1/scenes/a/rays/any HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: "
      "1000000\r\n\r\n";
  answers = Client(server.port()).send(large + get("/other")).read_all();
  EXPECT_EQ(count(answers, "HTTP/1.1"), 1U) << answers;
  EXPECT_TRUE(has(answers, "503") && has(answers, "Connection: close")) << answers;
}

TEST(Refusal, who_still_sends_a_large_body_is_told) {
  FewThreads server(100, 1);
  Client held(server.port());
  held.send(ask_sensor("Connection: close\r\n"));
  while (server.started() < 1) std::this_thread::yield();
  const std::string part(100'000, 'x');
  int went_through = 0;
  for (int i = 0; i < 10; ++i) {
    Client client(server.port());
    client.send(
        "POST /v1/scenes/a/rays/any HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: "
        "1000000\r\n\r\n" +
        part);
    std::this_thread::sleep_for(milliseconds(20));
    // Were the connection closed at once, this would fail, and many clients would not look for an answer.
    went_through += client.try_send(part) ? 1 : 0;
    const std::string answer = client.read_all();
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 503") && answer.ends_with("}")) << answer;
  }
  EXPECT_GE(went_through, 5) << "it is read and thrown away for a while";
}

TEST(Refusal, who_has_not_sent_a_body_keeps_nobody_out) {
  FewThreads server(100, 1);
  std::string begun = ask_sensor("Connection: close\r\n");
  const char last = begun.back();
  begun.pop_back();
  Client slow(server.port());
  slow.send(begun);
  while (server.in_flight() < 1) std::this_thread::yield();
  server.release();
  EXPECT_TRUE(has(Client(server.port()).send(ask_sensor("Connection: close\r\n")).read_all(), "came"));
  EXPECT_EQ(server.in_flight(), 1U);
  EXPECT_TRUE(has(slow.send(std::string(1, last)).read_all(), "came"));
}

TEST(Refusal, the_rest_of_a_refused_body_is_no_request) {
  FewThreads server(100, 1);
  Client held(server.port());
  held.send(ask_sensor("Connection: close\r\n"));
  while (server.started() < 1) std::this_thread::yield();
  // The body is a request, and comes in two parts after its head has been refused.
  const std::string body = get("/other", "") + get("/other", "");
  Client client(server.port());
  client.send(
      "POST /v1/scenes/a/sensors HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: " +
      std::to_string(body.size()) + "\r\n\r\n");
  std::this_thread::sleep_for(milliseconds(50));
  client.send(body.substr(0, 10));
  std::this_thread::sleep_for(milliseconds(50));
  const std::string answers = client.send(body.substr(10) + get("/healthz/live")).read_all();
  EXPECT_EQ(count(answers, "HTTP/1.1 503"), 1U) << answers;
  EXPECT_EQ(count(answers, "HTTP/1.1 200"), 1U) << answers;
  EXPECT_TRUE(has(answers, "live")) << answers;
}

}  // namespace
}  // namespace gridcast::server
