#include "server/access/caller.h"

#include <algorithm>
#include <cmath>

namespace gridcast::server::access {
namespace {

std::optional<proto::Problem> quota_problem(std::optional<double> wait_s, const char* detail) {
  if (!wait_s) return std::nullopt;
  constexpr double kLongest = 86'400.0;
  return proto::Problem{proto::ProblemCode::kQuotaExceeded, detail, "",
                        std::max(1, int(std::ceil(std::min(*wait_s, kLongest))))};
}

}  // namespace

bool Caller::sees_scene(std::string_view scene) const {
  return !token_.scenes || std::ranges::find(*token_.scenes, scene) != token_.scenes->end();
}

std::optional<proto::Problem> Caller::charge_request() {
  return quota_problem(requests_.refuse(1.0), "the token's requests per second are used up");
}

std::optional<proto::Problem> Caller::charge_rays(double rays) {
  return quota_problem(rays_.refuse(rays), "the token's rays per second are used up");
}

std::string owner_of(const HttpRequest& request) {
  return request.caller ? request.caller->token().name : std::string();
}

bool sees_scene(const HttpRequest& request, std::string_view scene) {
  return !request.caller || request.caller->sees_scene(scene);
}

bool sees_job_of(const HttpRequest& request, std::string_view owner) {
  return !request.caller || request.caller->token().role == Role::kAdmin ||
         request.caller->token().name == owner;
}

std::optional<proto::Problem> charge_rays(const HttpRequest& request, double rays) {
  return request.caller ? request.caller->charge_rays(rays) : std::nullopt;
}

}  // namespace gridcast::server::access
