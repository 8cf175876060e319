#pragma once

#include <string>
#include <string_view>

namespace gridcast::server {

class Job;
struct JobView;
struct RequestRecord;

enum class LogFormat { kText, kJson };

/// Once, before any other call. `level` is one of debug, info, warning, error, off. Writes to stderr.
void start_log(std::string_view level, LogFormat format);

/// One line for one answered request; for refusals that no thread was woken for, at most one in a second,
/// with their number since the last one.
void log_request(const RequestRecord& record);
/// One line for one job that has ended.
void log_job(const Job& job, const JobView& view);
void log_info(std::string_view text);
void log_warning(std::string_view text);
void log_error(std::string_view text);

/// Quotes, backslashes, controls and bytes outside ASCII as escapes: a client cannot forge a line.
[[nodiscard]] std::string escaped(std::string_view text);

}  // namespace gridcast::server
