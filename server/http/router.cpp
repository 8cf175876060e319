#include "server/http/router.h"

#include <optional>
#include <utility>

#include "server/http/url.h"

namespace gridcast::server {
namespace {

/// A segment of a pattern: the name of its capture (empty when it is plain text) and the text that ends it.
struct PatternSegment {
  std::string_view capture;
  std::string_view end;
};
PatternSegment read_segment(std::string_view segment) {
  const std::size_t brace = segment.find('}');
  if (!segment.starts_with('{') || brace == segment.npos) return {{}, segment};
  return {segment.substr(1, brace - 1), segment.substr(brace + 1)};
}

std::optional<std::map<std::string, std::string>> match_segments(const std::vector<std::string>& pattern,
                                                                 const std::vector<std::string>& path) {
  if (pattern.size() != path.size()) return std::nullopt;
  std::map<std::string, std::string> captures;
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    const auto [capture, end] = read_segment(pattern[i]);
    if (capture.empty() ? path[i] != end : !(path[i].ends_with(end) && path[i].size() > end.size()))
      return std::nullopt;
    if (!capture.empty())
      captures.emplace(std::string(capture), path[i].substr(0, path[i].size() - end.size()));
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
