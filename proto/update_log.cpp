#include "proto/update_log.h"

#include <limits>

#include "proto/vocabulary.h"

namespace gridcast::proto {

Parsed<LogQuery> parse_log_query(const QueryParameters& query, const Limits& limits) {
  QueryReader reader(query, {"since", "limit"});
  if (reader.find("since") == nullptr) reader.fail(ProblemCode::kMissingField, "since", "is required");
  LogQuery log;
  log.since = reader.integer("since", 1, std::numeric_limits<std::uint64_t>::max(), 1);
  log.limit = reader.integer("limit", 1, limits.log_lines, limits.log_lines);
  if (reader.problem()) return *reader.problem();
  return log;
}

void LogWriter::begin(std::uint64_t version) {
  text_.raw("{\"version\":");
  text_.number(version);
  text_.raw(",\"edits\":[");
  edits_ = 0;
}

void LogWriter::add(const TransactionEdit& edit) {
  if (edits_++ != 0) text_.raw(",");
  write_edit(text_, edit);
}

void LogWriter::end() {
  if (edits_ == 0) {
    PoseEditRequest nothing{std::string(kEditNames[4]), {}};
    nothing.pose.base = kPoseBaseNames[1];
    add(nothing);
  }
  text_.raw("]}\n");
}

}  // namespace gridcast::proto
