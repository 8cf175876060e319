#include "server/http/small_request.h"

#include <algorithm>
#include <array>

namespace gridcast::server {
namespace {

std::string_view path_of(const HttpHead& head) {
  return std::string_view(head.target).substr(0, head.target.find('?'));
}

}  // namespace

bool is_small_request(const HttpHead& head) {
  const std::string_view path = path_of(head);
  if (head.method == "GET" || head.method == "HEAD") return path.starts_with("/healthz/");
  // rays/all is not among them: a few rays may have many hits.
  constexpr std::array<std::string_view, 3> kQuestions{"/rays/closest", "/rays/any", "/rays/count"};
  return head.method == "POST" && head.framing == BodyFraming::kLength &&
         head.content_length <= kSmallBodyBytes && !head.find("content-encoding") &&
         std::ranges::any_of(kQuestions, [&](std::string_view end) { return path.ends_with(end); });
}

bool is_heavy_request(const HttpHead& head) {
  const std::string_view path = path_of(head);
  constexpr std::array<std::string_view, 4> kQuestions{"/rays/", "/points/", "/visibility", "/sensors"};
  return head.method == "POST" && !is_small_request(head) &&
         std::ranges::any_of(kQuestions, [&](std::string_view part) { return path.find(part) != path.npos; });
}

bool is_long_request(const HttpHead& head) {
  const std::string_view path = path_of(head);
  if (head.method == "PUT") return path.find("/meshes/") != path.npos && !path.ends_with("/weights");
  return head.method == "POST" && (path == "/v1/scenes" || path.ends_with("/renders"));
}

}  // namespace gridcast::server
