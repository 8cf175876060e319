#pragma once
// From the engine's answer about rays to the client's, the same for all routes that trace.

#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/math/hit_lists.h"
#include "core/scene/trace_stats.h"
#include "proto/hit_reply.h"
#include "proto/ray_options.h"
#include "server/http/problem.h"
#include "server/routes/api.h"
#include "server/routes/reply_format.h"

namespace gridcast::server {

/// What an answer about rays needs beside its columns.
struct RayReply {
  Api& api;
  std::uint64_t version;
  const proto::RayOptions& options;
  ReplyFormat format;
  const Cancellation& cancellation;
  Timing& timing;
};

[[nodiscard]] std::string encode(const HitColumns& hits, const proto::ReplyHead& head, ReplyFormat format);
[[nodiscard]] std::string encode(const std::vector<RayStatus>& status, const proto::ReplyHead& head,
                                 ReplyFormat format);
[[nodiscard]] std::string encode(const HitLists& lists, const proto::ReplyHead& head, ReplyFormat format);
[[nodiscard]] std::string encode(const HitCounts& counts, const proto::ReplyHead& head, ReplyFormat format);

[[nodiscard]] inline proto::BinaryBody write_binary(const HitColumns& hits, const proto::ReplyHead& head) {
  return write_hits_binary(hits, head);
}
[[nodiscard]] inline proto::BinaryBody write_binary(const std::vector<RayStatus>& status,
                                                    const proto::ReplyHead& head) {
  return write_occlusion_binary(status, head);
}

[[nodiscard]] proto::RayPlan plan_of(const scene::TraceStats& traced);

template <class Answer>
const std::vector<RayStatus>& statuses(const Answer& answer) {
  return answer.status;
}
inline const std::vector<RayStatus>& statuses(const std::vector<RayStatus>& status) {
  return status;
}

/// `body`, which views what `owner` holds, as a response of status 200: a large one leaves from where it
/// lies.
[[nodiscard]] HttpResponse binary_response(proto::BinaryBody body, std::shared_ptr<const void> owner,
                                           const RayReply& to);

/// The head of an answer, which is counted. `traced` is null where rays are taken as they come.
template <class Answer>
proto::ReplyHead head_of(const RayReply& to, const Answer& answer, const scene::TraceStats* traced,
                         double trace_ms) {
  to.api.metrics.count_rays(statuses(answer).size(), trace_ms);
  proto::ReplyHead head{to.version, to.options.fields, std::nullopt};
  if (to.options.stats == proto::StatsMode::kOn) {
    head.stats = proto::count_statuses(statuses(answer), trace_ms);
    if (traced != nullptr) head.stats->plan = plan_of(*traced);
  }
  return head;
}

/// In binary, without a copy where it is large.
template <class Answer>
HttpResponse reply_in_binary(const RayReply& to, Answer&& answer, const scene::TraceStats* traced,
                             double trace_ms) {
  const auto columns = std::make_shared<const std::decay_t<Answer>>(std::forward<Answer>(answer));
  return binary_response(write_binary(*columns, head_of(to, *columns, traced, trace_ms)), columns, to);
}

/// `write(answer, head, format)` makes the body.
template <class Answer, class Write>
HttpResponse reply_with(const RayReply& to, const Result<Answer>& answer, const scene::TraceStats* traced,
                        const Write& write) {
  const double trace_ms = to.timing.mark("trace");
  if (!answer)
    return problem_response(problem_of(answer.error(), proto::ErrorContext::kQuery, to.cancellation));
  std::string body = write(*answer, head_of(to, *answer, traced, trace_ms), to.format);
  to.timing.mark("encode");
  return columns_response(std::move(body), to.format, to.version, to.timing);
}
template <class Answer>
HttpResponse reply(const RayReply& to, const Result<Answer>& answer, const scene::TraceStats* traced) {
  return reply_with(to, answer, traced,
                    [](const Answer& columns, const proto::ReplyHead& head, ReplyFormat format) {
                      return encode(columns, head, format);
                    });
}
/// Closest hits in binary are not copied.
[[nodiscard]] HttpResponse reply(const RayReply& to, Result<HitColumns>&& hits,
                                 const scene::TraceStats* traced);

}  // namespace gridcast::server
