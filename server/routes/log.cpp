#include <algorithm>

#include "proto/etag.h"
#include "proto/update_log.h"
#include "server/http/problem.h"
#include "server/routes/api.h"
#include "server/routes/edit_lines.h"

namespace gridcast::server {
namespace {

using proto::Problem;

constexpr std::string_view kLinesMediaType = "application/x-ndjson";

HttpResponse get_log(Api& api, const HttpRequest& request, const Cancellation& cancellation) {
  const auto query = proto::parse_log_query(request.query, api.limits);
  if (!query) return problem_response(query.problem());
  const auto named = api.store.find(request.capture("s"));
  if (!named) return problem_response(api.store.why_missing(request.capture("s")));
  auto part = named->log_after(query->since, query->limit);
  if (auto* problem = std::get_if<Problem>(&part)) return problem_response(*problem);
  const NamedScene::LogPart& log = std::get<NamedScene::LogPart>(part);
  const auto permit = api.gate.enter(cancellation.token());
  if (!permit) return problem_response(cancelled_problem(cancellation.reason()));

  proto::LogWriter lines;
  std::uint64_t last = query->since;
  for (const LogLine& line : log.lines) {
    if (lines.size() > api.limits.json_bytes) break;
    if (cancellation.token().stop_requested())
      return problem_response(cancelled_problem(cancellation.reason()));
    write_line(line, lines);
    last = line.version;
  }
  HttpResponse response{200, std::string(kLinesMediaType), std::move(lines).take(), {}};
  response.with("Scene-Version", std::to_string(log.newest));
  if (last < log.newest)
    response.with("Link", "</v1/scenes/" + named->id() + "/log?since=" + std::to_string(last) +
                              "&limit=" + std::to_string(query->limit) + ">; rel=\"next\"");
  return response;
}

}  // namespace

void add_log_routes(Router& router, Api& api) {
  router.add({"GET", "/v1/scenes/{s}/log", {}, [&api](const HttpRequest& r, Cancellation& c) {
                return get_log(api, r, c);
              }});
}

}  // namespace gridcast::server
