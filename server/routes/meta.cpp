#include "core/math/instruction_set.h"
#include "proto/media_type.h"
#include "proto/openapi.h"
#include "proto/replies.h"
#include "server/http/problem.h"
#include "server/routes/api.h"

namespace gridcast::server {
namespace {

HttpResponse json(std::string body, int status = 200) {
  return {status, std::string(proto::kJsonMediaType), std::move(body), {}};
}

/// A GET that reads no query parameter.
Handler plain(std::function<HttpResponse()> answer) {
  return [answer = std::move(answer)](const HttpRequest& request, Cancellation&) {
    if (const auto problem = proto::check_query(request.query)) return problem_response(*problem);
    return answer();
  };
}

}  // namespace

void add_meta_routes(Router& router, Api& api) {
  router.add({"GET", "/v1", {}, plain([&api] {
                return json(to_json(proto::ServiceInfo{GRIDCAST_VERSION, std::string(instruction_set()),
                                                       api.threads, api.limits}));
              })});
  router.add({"GET", "/healthz/live", {}, plain([] { return json(proto::health_json("live")); })});
  router.add({"GET", "/healthz/ready", {}, plain([&api] {
                if (api.ready()) return json(proto::health_json("ready"));
                return problem_response({proto::ProblemCode::kNotReady, "scenes are still being loaded", ""});
              })});
  router.add({"GET", "/metrics", {}, plain([&api] {
                api.metrics.set_memory(api.memory);
                return HttpResponse{
                    200,
                    "text/plain; version=0.0.4; charset=utf-8",
                    api.metrics.text(api.store, api.jobs.counts(), api.trees.counts(),
                                     api.archive ? api.archive->counts() : store::ArchiveCounts{},
                                     api.requests_in_flight()),
                    {}};
              })});
  router.add({"GET", "/openapi.json", {}, plain([] { return json(std::string(proto::openapi_json())); })});
}

}  // namespace gridcast::server
