#include "server/http/address_limit.h"

#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "tests/unit/server/http/few_threads.h"

namespace gridcast::server {
namespace {

HttpServerOptions at_most_two() {
  HttpServerOptions options = FewThreads::options(100);
  options.connections_per_address = 2;
  return options;
}

/// Until its connection is counted, or refused.
std::string first_answer(Client& client) {
  return client.send(get("/healthz/live", "")).read_answer();
}

TEST(AddressLimit, one_address_gets_its_share_and_leaves_the_rest_to_others) {
  FewThreads server(at_most_two());
  Client one(server.port()), two(server.port());
  EXPECT_TRUE(has(first_answer(one), "live") && has(first_answer(two), "live"));
  for (int i = 0; i < 5; ++i) {
    Client third(server.port());
    const std::string answer = third.send(get("/healthz/live", "")).read_all();
    EXPECT_TRUE(answer.starts_with("HTTP/1.1 503") && answer.ends_with("}")) << answer;
    EXPECT_TRUE(has(answer, "one address") && has(answer, "Retry-After: ")) << answer;
  }
  Client stranger(server.port(), 2);
  EXPECT_TRUE(has(first_answer(stranger), "live"));
  EXPECT_TRUE(has(first_answer(one), "live")) << "who is there stays";
}

TEST(AddressLimit, who_leaves_makes_room) {
  FewThreads server(at_most_two());
  Client one(server.port());
  EXPECT_TRUE(has(first_answer(one), "live"));
  for (int i = 0; i < 20; ++i)
    ASSERT_TRUE(has(ask_until_served(server.port(), get("/healthz/live")), "live")) << i;
}

TEST(AddressLimit, without_one_everybody_comes_in) {
  FewThreads server(100);
  std::list<Client> many;
  for (int i = 0; i < 200; ++i) EXPECT_TRUE(has(first_answer(many.emplace_back(server.port())), "live"));
}

}  // namespace
}  // namespace gridcast::server
