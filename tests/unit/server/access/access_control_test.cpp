#include "server/access/access_control.h"

#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include "server/access/token_file.h"

namespace gridcast::server::access {
namespace {

using proto::ProblemCode;

std::string line_of(const std::string& name, Role role, const std::string& secret,
                    std::optional<std::vector<std::string>> scenes = {}) {
  Token token{name, store::sha256(secret), role, std::move(scenes), {}, {}};
  return to_line(token) + "\n";
}

TEST(Tokens, a_line_reads_back_as_it_was_written) {
  Token token{"lab", store::sha256("secret"), Role::kWrite, std::vector<std::string>{"a", "b"}, 2.5, 1e6};
  const auto read = parse_tokens("# who\n\n" + to_line(token) + "\r\n" + line_of("x", Role::kAdmin, "other"));
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->size(), 2U);
  EXPECT_EQ(read->front().name, "lab");
  EXPECT_EQ(read->front().sha256, store::sha256("secret"));
  EXPECT_EQ(read->front().role, Role::kWrite);
  EXPECT_EQ(read->front().scenes, token.scenes);
  EXPECT_EQ(read->front().requests_per_s, 2.5);
  EXPECT_EQ(read->front().rays_per_s, 1e6);
  EXPECT_EQ(read->back().role, Role::kAdmin);
  EXPECT_FALSE(read->back().scenes);
}

TEST(Tokens, what_could_grant_too_much_by_mistake_is_an_error) {
  const std::string digest = store::to_hex(store::sha256("x"));
  const std::string start = R"({"name": "n", "sha256": ")" + digest + R"(", "role": )";
  for (const std::string& line :
       {start + R"("read", "scene": ["a"]})", start + R"("read", "scenes": []})",
        start + R"("read", "scenes": ["a/b"]})", start + R"("root"})", start + R"("admin", "scenes": ["a"]})",
        start + R"("read", "role": "admin"})", start + R"("read", "rays_per_s": 0})",
        start + R"("read", "rays_per_s": "1"})", start + R"("read"} trailing)", std::string("[]"),
        std::string(R"({"name": "n", "sha256": "00", "role": "read"})"),
        R"({"name": "a b", "sha256": ")" + digest + R"(", "role": "read"})",
        R"({"name": "n", "sha256": ")" + digest + R"("})"}) {
    const auto read = parse_tokens(line_of("first", Role::kRead, "first") + line);
    ASSERT_FALSE(read) << line;
    EXPECT_EQ(read.error().where, "line 2") << line;
  }
  EXPECT_FALSE(parse_tokens(line_of("n", Role::kRead, "a") + line_of("n", Role::kRead, "b")));
  EXPECT_FALSE(parse_tokens(line_of("n", Role::kRead, "a") + line_of("m", Role::kRead, "a")));
}

TEST(Tokens, a_new_one_is_256_bits_and_never_the_same) {
  const std::string token = make_token();
  EXPECT_TRUE(token.starts_with("gridcast_"));
  EXPECT_EQ(token.size(), 9U + 64U);
  EXPECT_NE(token, make_token());
}

TEST(Access, what_a_route_needs) {
  const auto role = [](const char* method, const char* pattern) { return need_of(method, pattern).role; };
  const std::string scene = "/v1/scenes/{s}";
  for (const char* rest : {"/rays/closest", "/rays/all", "/points/inside", "/renders", "/tradeoffs"})
    EXPECT_EQ(role("POST", (scene + rest).c_str()), Role::kRead) << rest;
  for (const char* rest : {"/instances", "/transactions", "/raysomething", ""})
    EXPECT_EQ(role("POST", (scene + rest).c_str()), Role::kWrite) << rest;
  for (const char* method : {"PUT", "PATCH", "DELETE", "NEW"})
    EXPECT_EQ(role(method, (scene + "/rays/closest").c_str()), Role::kWrite) << method;
  EXPECT_EQ(role("DELETE", "/v1/jobs/{j}"), Role::kRead);
  EXPECT_EQ(role("GET", "/metrics"), Role::kRead);
  EXPECT_TRUE(need_of("POST", "/v1/scenes").every_scene);
  EXPECT_TRUE(need_of("POST", "/v1/scenes/{s}:fork").every_scene);
  EXPECT_TRUE(need_of("DELETE", "/v1/scenes/{s}").every_scene);
  EXPECT_FALSE(need_of("DELETE", "/v1/scenes/{s}/instances/{i}").every_scene);
  EXPECT_EQ(need_of("GET", "/healthz/live").who, Need::Who::kAnybody);
  EXPECT_EQ(need_of("GET", "").who, Need::Who::kToken);
}

/// A tokens file of a test's own.
class AccessFile : public ::testing::Test {
 protected:
  AccessFile() : path_(::testing::TempDir() + "gridcast_tokens_" + std::to_string(::getpid())) {}
  ~AccessFile() override { std::filesystem::remove(path_); }

  void write(const std::string& text, std::filesystem::perms perms = std::filesystem::perms(0600)) const {
    std::ofstream(path_) << text;
    std::filesystem::permissions(path_, perms);
  }
  std::unique_ptr<AccessControl> open() const { return AccessControl::open(path_).value(); }

  static std::string outcome(const AccessControl& access, const std::string& header,
                             const std::string& method, const std::string& pattern,
                             const std::string& scene = {}) {
    HttpRequest request;
    request.method = method;
    if (!header.empty()) request.headers["authorization"] = header;
    if (!scene.empty()) request.captures["s"] = scene;
    const auto admitted = access.admit(request, pattern);
    if (const auto* problem = std::get_if<proto::Problem>(&admitted))
      return std::string(proto::describe(problem->code).name);
    const auto& caller = std::get<std::shared_ptr<Caller>>(admitted);
    return caller ? caller->token().name : "anybody";
  }

  std::string path_;
};

TEST_F(AccessFile, only_a_whole_token_of_the_file_is_taken) {
  write(line_of("one", Role::kRead, "secret1") + line_of("two", Role::kRead, "secret2"));
  const auto access = open();
  const auto who = [&](const std::string& header) { return outcome(*access, header, "GET", "/v1"); };
  EXPECT_EQ(who("Bearer secret1"), "one");
  EXPECT_EQ(who("bEARER secret2"), "two");
  for (const char* header :
       {"", "secret1", "Bearer", "Bearer ", "Bearer secret", "Bearer secret11", "Bearer  secret1",
        "Bearer secret1, Bearer secret1", "Basic secret1", "Bearer Secret1", "Bearer secret1 "})
    EXPECT_EQ(who(header), "unauthorized") << header;
  EXPECT_EQ(who("Bearer " + store::to_hex(store::sha256("secret1"))), "unauthorized") << "the file's digest";
  EXPECT_EQ(outcome(*access, "", "GET", "/healthz/ready"), "anybody");
}

TEST_F(AccessFile, roles_and_scenes_are_kept_apart) {
  write(line_of("reader", Role::kRead, "r", std::vector<std::string>{"a"}) +
        line_of("writer", Role::kWrite, "w", std::vector<std::string>{"a"}) +
        line_of("maker", Role::kWrite, "m") + line_of("admin", Role::kAdmin, "x"));
  const auto access = open();
  const auto ask = [&](const char* token, const char* method, const std::string& pattern,
                       const char* scene = "") {
    return outcome(*access, std::string("Bearer ") + token, method, pattern, scene);
  };
  const std::string scene = "/v1/scenes/{s}";
  EXPECT_EQ(ask("r", "GET", scene, "a"), "reader");
  EXPECT_EQ(ask("r", "POST", scene + "/rays/any", "a"), "reader");
  EXPECT_EQ(ask("r", "POST", scene + "/instances", "a"), "forbidden");
  EXPECT_EQ(ask("w", "POST", scene + "/instances", "a"), "writer");
  for (const char* token : {"r", "w"})
    for (const char* method : {"GET", "DELETE"})
      EXPECT_EQ(ask(token, method, scene, "b"), "scene_not_found") << token << method;
  EXPECT_EQ(ask("w", "DELETE", scene, "a"), "forbidden");
  EXPECT_EQ(ask("w", "POST", "/v1/scenes"), "forbidden");
  EXPECT_EQ(ask("m", "POST", "/v1/scenes"), "maker");
  EXPECT_EQ(ask("x", "DELETE", scene, "b"), "admin");
}

TEST_F(AccessFile, a_file_that_others_may_touch_is_refused) {
  const std::string text = line_of("one", Role::kRead, "secret");
  write(text);
  EXPECT_TRUE(AccessControl::open(path_));
  for (const int mode : {0604, 0602, 0620, 0666}) {
    write(text, std::filesystem::perms(mode));
    const auto opened = AccessControl::open(path_);
    ASSERT_FALSE(opened) << mode;
    EXPECT_NE(opened.error().message.find("chmod"), std::string::npos);
  }
  write("# nobody\n");
  EXPECT_FALSE(AccessControl::open(path_));
  EXPECT_FALSE(AccessControl::open(path_ + ".none"));
  EXPECT_FALSE(AccessControl::open(::testing::TempDir()));
}

TEST_F(AccessFile, reading_again_takes_new_tokens_and_drops_old_ones) {
  write(line_of("one", Role::kRead, "secret1"));
  const auto access = open();
  write(line_of("two", Role::kRead, "secret2"));
  ASSERT_TRUE(access->reload());
  EXPECT_EQ(outcome(*access, "Bearer secret1", "GET", "/v1"), "unauthorized");
  EXPECT_EQ(outcome(*access, "Bearer secret2", "GET", "/v1"), "two");
  write("nonsense");
  EXPECT_FALSE(access->reload());
  EXPECT_EQ(outcome(*access, "Bearer secret2", "GET", "/v1"), "two") << "kept as they were";
}

TEST(RateLimit, a_second_at_once_and_the_rate_after) {
  RateLimit limit(10.0);
  const Clock::time_point start = Clock::now();
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(limit.refuse(1.0, start)) << i;
  EXPECT_NEAR(limit.refuse(1.0, start).value(), 0.1, 1e-9);
  EXPECT_TRUE(limit.refuse(1.0, start + std::chrono::milliseconds(90)));
  EXPECT_FALSE(limit.refuse(1.0, start + std::chrono::milliseconds(110)));
  EXPECT_FALSE(RateLimit(std::nullopt).refuse(1e30));
}

TEST(RateLimit, what_is_larger_than_the_bucket_passes_once_and_is_paid_back) {
  RateLimit limit(10.0);
  const Clock::time_point start = Clock::now();
  EXPECT_FALSE(limit.refuse(30.0, start)) << "a full bucket";
  EXPECT_NEAR(limit.refuse(1.0, start).value(), 2.1, 1e-9) << "20 of debt and 1";
  EXPECT_TRUE(limit.refuse(30.0, start + std::chrono::milliseconds(2500)));
  EXPECT_FALSE(limit.refuse(30.0, start + std::chrono::milliseconds(3000)));
}

TEST(RateLimit, less_than_one_a_second_still_lets_one_through) {
  RateLimit limit(0.5);
  const Clock::time_point start = Clock::now();
  EXPECT_FALSE(limit.refuse(1.0, start));
  EXPECT_NEAR(limit.refuse(1.0, start).value(), 2.0, 1e-9);
}

}  // namespace
}  // namespace gridcast::server::access
