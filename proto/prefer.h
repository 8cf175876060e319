#pragma once
// The Prefer header (RFC 7240): what a client would like, never an error.

#include <optional>
#include <string_view>

namespace gridcast::proto {

/// What is known here; other preferences are ignored, and so is one that breaks the grammar.
struct Preferences {
  bool respond_async = false;    ///< 202 and a job instead of the answer
  std::optional<double> wait_s;  ///< how long the client waits for the answer before it takes the job
};

[[nodiscard]] Preferences parse_prefer(std::string_view header);

}  // namespace gridcast::proto
