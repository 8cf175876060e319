#include "server/http/http_head.h"

#include <gtest/gtest.h>

namespace gridcast::server {
namespace {

using proto::ProblemCode;

std::variant<HttpHead, HeadError> parse(const std::string& text) {
  return parse_head(text);
}
ProblemCode refusal(const std::string& text) {
  const auto result = parse(text);
  const auto* error = std::get_if<HeadError>(&result);
  return error == nullptr ? ProblemCode::kInternal : error->code;
}

TEST(HttpHead, a_plain_post_is_read) {
  const auto result = parse(
      "POST /v1/scenes?name=a HTTP/1.1\r\nHost: x\r\nContent-Type: model/gltf-binary\r\nContent-Length: "
      "12\r\n\r\n");
  const HttpHead& head = std::get<HttpHead>(result);
  EXPECT_EQ(head.method, "POST");
  EXPECT_EQ(head.target, "/v1/scenes?name=a");
  EXPECT_EQ(head.framing, BodyFraming::kLength);
  EXPECT_EQ(head.content_length, 12U);
  EXPECT_EQ(head.find("content-type"), "model/gltf-binary");
  EXPECT_FALSE(head.wants_close());
}

TEST(HttpHead, two_statements_of_the_length_are_refused) {
  const std::string start = "POST / HTTP/1.1\r\nHost: x\r\n";
  EXPECT_EQ(refusal(start + "Content-Length: 1\r\nContent-Length: 1\r\n\r\n"), ProblemCode::kInvalidRequest);
  EXPECT_EQ(refusal(start + "Content-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n"),
            ProblemCode::kInvalidRequest);
  EXPECT_EQ(refusal(start + "Transfer-Encoding: gzip, chunked\r\n\r\n"), ProblemCode::kLengthRequired);
}

TEST(HttpHead, lengths_that_are_not_plain_digits_are_refused) {
  for (const char* length : {"", "-1", "+1", "0x10", "1 2", "1,1", "9999999999999999999"})
    EXPECT_EQ(refusal(std::string("POST / HTTP/1.1\r\nHost: x\r\nContent-Length: ") + length + "\r\n\r\n"),
              ProblemCode::kInvalidRequest)
        << length;
}

TEST(HttpHead, what_parsers_disagree_about_is_refused) {
  for (const char* text :
       {"GET / HTTP/1.1\r\nHost : x\r\n\r\n", "GET / HTTP/1.1\r\nHost: x\r\n folded\r\n\r\n",
        "GET / HTTP/1.1\nHost: x\r\n\r\n", "GET  / HTTP/1.1\r\nHost: x\r\n\r\n", "GET / HTTP/1.1\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: x\r\nHost: y\r\n\r\n", "GET /\x01 HTTP/1.1\r\nHost: x\r\n\r\n",
        "GET / HTTP/2.0\r\nHost: x\r\n\r\n", "GET http://a/ HTTP/1.1\r\nHost: x\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: x\r\nA: b\x7f\r\n\r\n"})
    EXPECT_EQ(refusal(text), ProblemCode::kInvalidRequest) << text;
  EXPECT_EQ(refusal(std::string("GET / HTTP/1.1\r\nHost: x\r\nA: b") + '\0' + "c\r\n\r\n"),
            ProblemCode::kInvalidRequest);
}

TEST(HttpHead, limits_have_their_own_codes) {
  const std::string long_target(kMaxTargetBytes + 1, 'a');
  EXPECT_EQ(refusal("GET /" + long_target + " HTTP/1.1\r\nHost: x\r\n\r\n"), ProblemCode::kUriTooLong);
  std::string many = "GET / HTTP/1.1\r\nHost: x\r\n";
  for (std::size_t i = 0; i < kMaxHeaders; ++i) many += "A: b\r\n";
  EXPECT_EQ(refusal(many + "\r\n"), ProblemCode::kHeadersTooLarge);
  EXPECT_EQ(refusal("BREW / HTTP/1.1\r\nHost: x\r\n\r\n"), ProblemCode::kMethodNotAllowed);
}

TEST(HttpHead, old_clients_close_unless_they_ask_to_stay) {
  EXPECT_TRUE(std::get<HttpHead>(parse("GET / HTTP/1.0\r\n\r\n")).wants_close());
  EXPECT_FALSE(std::get<HttpHead>(parse("GET / HTTP/1.0\r\nConnection: keep-alive\r\n\r\n")).wants_close());
  EXPECT_TRUE(
      std::get<HttpHead>(parse("GET / HTTP/1.1\r\nHost: x\r\nConnection: Close\r\n\r\n")).wants_close());
}

}  // namespace
}  // namespace gridcast::server
