#pragma once
// Query parameters, already percent-decoded. Unknown, repeated and malformed ones are problems with the
// pointer `?name`.

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/parsed.h"

namespace gridcast::proto {

using QueryParameters = std::vector<std::pair<std::string, std::string>>;

/// Reads parameters one by one and keeps the first problem; after one, every getter returns its fallback.
class QueryReader {
 public:
  QueryReader(const QueryParameters& parameters, std::span<const std::string_view> known);
  QueryReader(const QueryParameters& parameters, std::initializer_list<std::string_view> known)
      : QueryReader(parameters, std::span(known.begin(), known.size())) {}

  /// Null when the parameter is absent.
  [[nodiscard]] const std::string* find(std::string_view name) const;
  /// One of `names`, or `fallback` when absent.
  std::string choice(std::string_view name, std::span<const std::string_view> names,
                     std::string_view fallback);
  /// A decimal integer in [low, high].
  std::uint64_t integer(std::string_view name, std::uint64_t low, std::uint64_t high, std::uint64_t fallback);
  /// A finite number in [low, high].
  std::optional<double> number(std::string_view name, double low, double high);
  /// `true` or `false`.
  std::optional<bool> flag(std::string_view name);

  void fail(ProblemCode code, std::string_view name, std::string detail);
  [[nodiscard]] const std::optional<Problem>& problem() const { return problem_; }

 private:
  const QueryParameters& parameters_;
  std::optional<Problem> problem_;
};

/// Nothing when every parameter is one of `known` and given once: for routes that read none or few.
[[nodiscard]] std::optional<Problem> check_query(const QueryParameters& parameters,
                                                 std::initializer_list<std::string_view> known = {});

/// What every read of a scene knows beside its own parameters.
inline constexpr std::string_view kAtVersion = "at_version";
/// `?at_version=V`, 1 or more; nothing when it is absent. Repetition is for the reader of all parameters.
[[nodiscard]] Parsed<std::optional<std::uint64_t>> parse_at_version(const QueryParameters& query);

/// `?offset=&limit=` of lists of one version.
struct Page {
  std::size_t offset = 0;
  std::size_t limit = 1000;
};
[[nodiscard]] Parsed<Page> parse_page(const QueryParameters& query, std::size_t max_limit);

}  // namespace gridcast::proto
