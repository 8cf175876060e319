#include "server/http/router.h"

#include <gtest/gtest.h>

#include "server/http/url.h"

namespace gridcast::server {
namespace {

Router three_routes() {
  Router router;
  router.add({"GET", "/v1/scenes", {}, {}});
  router.add({"GET", "/v1/scenes/{s}", {}, {}});
  router.add({"DELETE", "/v1/scenes/{s}", {}, {}});
  return router;
}

TEST(Router, captures_are_decoded_segments) {
  const Router router = three_routes();
  const Router::Match match = router.match("GET", "/v1/scenes/a%2Eb");
  ASSERT_NE(match.route, nullptr);
  EXPECT_EQ(match.route->pattern, "/v1/scenes/{s}");
  EXPECT_EQ(match.captures.at("s"), "a.b");
}

TEST(Router, head_is_answered_by_get) {
  const Router router = three_routes();
  EXPECT_EQ(router.match("HEAD", "/v1/scenes").route, router.match("GET", "/v1/scenes").route);
}

TEST(Router, an_unknown_method_names_the_known_ones) {
  const Router router = three_routes();
  const Router::Match match = router.match("PUT", "/v1/scenes/a");
  EXPECT_EQ(match.route, nullptr);
  EXPECT_EQ(match.allowed, "GET, HEAD, DELETE");
}

TEST(Router, a_capture_may_have_an_end) {
  Router router = three_routes();
  router.add({"POST", "/v1/scenes/{s}:fork", {}, {}});
  const Router::Match match = router.match("POST", "/v1/scenes/a:b:fork");
  ASSERT_NE(match.route, nullptr);
  EXPECT_EQ(match.captures.at("s"), "a:b");
  EXPECT_EQ(router.match("POST", "/v1/scenes/:fork").route, nullptr);
  EXPECT_EQ(router.match("POST", "/v1/scenes/a").route, nullptr);
  EXPECT_EQ(router.match("POST", "/v1/scenes/a:fork2").route, nullptr);
}

TEST(Router, unknown_and_malformed_paths_match_nothing) {
  const Router router = three_routes();
  for (const char* path :
       {"/", "/v2", "/v1/scenes/", "/v1//scenes", "/v1/scenes/a/b", "/v1/scenes/%", "/v1/scenes/%2",
        "/v1/scenes/%zz", "/v1/scenes/%00", "/v1/scenes/%2e%2e", "/v1/scenes/a%2fb"}) {
    const Router::Match match = router.match("GET", path);
    EXPECT_EQ(match.route, nullptr) << path;
    EXPECT_TRUE(match.allowed.empty()) << path;
  }
}

TEST(Url, a_query_is_decoded_in_order) {
  const auto query = parse_query("b=1+2&a=%41&&c");
  ASSERT_TRUE(query);
  EXPECT_EQ(*query, (proto::QueryParameters{{"b", "1 2"}, {"a", "A"}, {"c", ""}}));
  EXPECT_FALSE(parse_query("a=%4"));
}

}  // namespace
}  // namespace gridcast::server
