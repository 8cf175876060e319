#include "server/router.h"

#include <optional>
#include <utility>

#include "server/url.h"

namespace gridcast::server {
namespace {

bool is_capture(const std::string& segment) {
  return segment.size() > 2 && segment.front() == '{' && segment.back() == '}';
}

std::optional<std::map<std::string, std::string>> match_segments(const std::vector<std::string>& pattern,
                                                                 const std::vector<std::string>& path) {
  if (pattern.size() != path.size()) return std::nullopt;
  std::map<std::string, std::string> captures;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    if (is_capture(pattern[i]))
      captures.emplace(pattern[i].substr(1, pattern[i].size() - 2), path[i]);
    else if (pattern[i] != path[i])
      return std::nullopt;
  }
  return captures;
}

void append_allowed(std::string& allowed, const std::string& method) {
  if (!allowed.empty()) allowed += ", ";
  allowed += method == "GET" ? "GET, HEAD" : method;
}

}  // namespace

void Router::add(Route route) {
  std::vector<std::string> segments = split_path(route.pattern).value_or(std::vector<std::string>());
  entries_.push_back({std::move(route), std::move(segments)});
}

Router::Match Router::match(std::string_view method, std::string_view path) const {
  Match result;
  const auto segments = split_path(path);
  if (!segments) return result;
  const std::string_view wanted = method == "HEAD" ? "GET" : method;
  for (const Entry& entry : entries_) {
    auto captures = match_segments(entry.segments, *segments);
    if (!captures) continue;
    append_allowed(result.allowed, entry.route.method);
    if (entry.route.method != wanted || result.route != nullptr) continue;
    result.route = &entry.route;
    result.captures = std::move(*captures);
  }
  return result;
}

}  // namespace gridcast::server
