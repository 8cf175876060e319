#pragma once
// GET .../log: the updates of a scene, as lines that POST .../transactions takes one after the other.

#include <cstdint>
#include <string>

#include "proto/edit_writer.h"
#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/query.h"

namespace gridcast::proto {

/// `?since=V&limit=N`: the versions after V, at most N of them.
struct LogQuery {
  std::uint64_t since = 0;
  std::size_t limit = 0;
};
/// `since` must be there; `limit` is limits.log_lines when absent, and no more.
[[nodiscard]] Parsed<LogQuery> parse_log_query(const QueryParameters& query, const Limits& limits);

/// Lines of {"version": 7, "edits": [...]}.
class LogWriter {
 public:
  void begin(std::uint64_t version);
  void add(const TransactionEdit& edit);
  /// A version without an edit changed nothing: it is written as a pose that changes nothing, since a
  /// transaction has at least one edit.
  void end();
  [[nodiscard]] std::size_t size() const { return text_.size(); }
  [[nodiscard]] std::string take() && { return std::move(text_).take(); }

 private:
  JsonText text_{0};
  std::size_t edits_ = 0;  ///< of the line
};

}  // namespace gridcast::proto
