#include "server/log.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <memory>

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include "core/error.h"
#include "server/http/http_server.h"
#include "server/jobs.h"

namespace gridcast::server {
namespace {

LogFormat format_in_use = LogFormat::kText;

void write(spdlog::level::level_enum level, std::string_view text) {
  if (format_in_use == LogFormat::kJson)
    spdlog::log(level, "\"message\": \"{}\"", escaped(text));
  else
    spdlog::log(level, "{}", escaped(text));
}

/// Thousands a second, where more is asked for than can be done.
class RefusalLog {
 public:
  void count() {
    ++refused_;
    const auto now = Clock::now().time_since_epoch().count();
    auto next = next_.load();
    if (now < next || !next_.compare_exchange_strong(next, now + Clock::duration(kPeriod).count())) return;
    const std::uint64_t refused = refused_.exchange(0);
    if (format_in_use == LogFormat::kJson)
      spdlog::warn("\"refused\": {}", refused);
    else
      spdlog::warn("refused {}", refused);
  }

 private:
  static constexpr std::chrono::seconds kPeriod{1};
  std::atomic<std::uint64_t> refused_{0};
  std::atomic<Clock::rep> next_{0};
};

}  // namespace

void start_log(std::string_view level, LogFormat format) {
  format_in_use = format;
  auto logger =
      std::make_shared<spdlog::logger>("gridcast", std::make_shared<spdlog::sinks::stderr_sink_mt>());
  logger->set_pattern(format == LogFormat::kJson ? R"({"time": "%Y-%m-%dT%H:%M:%S.%eZ", "level": "%l", %v})"
                                                 : "%Y-%m-%dT%H:%M:%S.%eZ %l %v",
                      spdlog::pattern_time_type::utc);
  logger->set_level(spdlog::level::from_str(std::string(level)));
  spdlog::set_default_logger(std::move(logger));
}

void log_request(const RequestRecord& record) {
  static RefusalLog refusals;
  if (record.is_refusal()) {
    refusals.count();
    return;
  }
  const auto level = record.status >= 500 ? spdlog::level::warn : spdlog::level::info;
  const auto or_dash = [](std::string_view text) { return text.empty() ? std::string_view("-") : text; };
  const std::string_view route = or_dash(record.route);
  const std::string_view method = or_dash(record.method);
  if (format_in_use == LogFormat::kJson)
    spdlog::log(level,
                "\"method\": \"{}\", \"route\": \"{}\", \"status\": {}, \"ms\": {:.3f}, \"bytes_in\": {}, "
                "\"bytes_out\": {}, \"request_id\": \"{}\", \"token\": \"{}\"",
                method, route, record.status, record.ms, record.bytes_in, record.bytes_out, record.request_id,
                record.caller);
  else
    spdlog::log(level, "{} {} {} {:.3f} ms in {} out {} id {} token {}", method, route, record.status,
                record.ms, record.bytes_in, record.bytes_out, record.request_id, or_dash(record.caller));
}

void log_job(const Job& job, const JobView& view) {
  const std::string& kind = job.subject().kind;
  const std::string_view state = to_string(view.state);
  const std::size_t bytes = view.result ? view.result->body.size() : 0;
  const auto level = view.state == JobState::kFailed ? spdlog::level::warn : spdlog::level::info;
  if (format_in_use == LogFormat::kJson)
    spdlog::log(level,
                "\"job\": \"{}\", \"kind\": \"{}\", \"state\": \"{}\", \"wait_ms\": {:.3f}, "
                "\"run_ms\": {:.3f}, \"bytes_out\": {}",
                job.id(), kind, state, view.wait_ms, view.run_ms, bytes);
  else
    spdlog::log(level, "job {} {} {} waited {:.3f} ms ran {:.3f} ms out {}", job.id(), kind, state,
                view.wait_ms, view.run_ms, bytes);
}

void log_info(std::string_view text) {
  write(spdlog::level::info, text);
}
void log_warning(std::string_view text) {
  write(spdlog::level::warn, text);
}
void log_error(std::string_view text) {
  write(spdlog::level::err, text);
}

std::string escaped(std::string_view text) {
  std::string result;
  result.reserve(text.size());
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      result.append({'\\', c});
    } else if (byte < 0x20 || byte >= 0x7f) {
      char code[8];
      std::snprintf(code, sizeof(code), "\\u%04x", unsigned(byte));
      result += code;
    } else {
      result += c;
    }
  }
  return result;
}

}  // namespace gridcast::server
