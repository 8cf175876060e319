// Bodies in JSON: the first byte chooses the request, the rest is the body.

#include <nlohmann/json.hpp>

#include "proto/explain_request.h"
#include "proto/point_request.h"
#include "proto/pose_request.h"
#include "proto/ray_request.h"
#include "proto/render_request.h"
#include "proto/scene_request.h"
#include "proto/sensor_request.h"
#include "proto/tradeoff_request.h"
#include "proto/transaction.h"
#include "proto/vertex_request.h"
#include "proto/visibility_request.h"
#include "tests/fuzz/fuzz_input.h"

using namespace gridcast;

namespace {

/// A refusal is a problem of the client's making, told in JSON.
template <class T>
void check(const proto::Parsed<T>& parsed) {
  if (parsed.ok()) return;
  const proto::Problem& problem = parsed.problem();
  fuzz::require(problem.status() >= 400 && problem.status() < 500, "a refusal blames the server");
  fuzz::require(!problem.detail.empty(), "a refusal says nothing");
  fuzz::require(nlohmann::json::accept(proto::to_json(problem)), "a problem is no JSON");
}

void check_rays(std::string_view body, const proto::Limits& limits, proto::RayQuestion question) {
  const auto parsed = proto::parse_ray_request("application/json", body, {}, limits, question);
  check(parsed);
  if (!parsed.ok()) return;
  const RayBatch batch = parsed.value().batch();
  for (std::size_t i = 0; i < batch.size(); ++i) (void)is_valid(batch[i]);
}

void check_pairs(std::string_view body, const proto::Limits& limits) {
  const auto parsed = proto::parse_visibility_request("application/json", body, {}, limits);
  check(parsed);
  if (!parsed.ok()) return;
  const PairBatch batch = parsed.value().batch();
  for (std::size_t i = 0; i < batch.size(); ++i) (void)batch.from(i), (void)batch.to(i);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace gridcast::proto;
  fuzz::FuzzInput input(data, size);
  const std::uint32_t which = input.below(16);
  const std::string_view body = input.text();
  const Limits limits;
  switch (which) {
    case 0:
    case 1:
    case 2:
    case 3:
      check_rays(body, limits, RayQuestion(which));
      break;
    case 4:
      for (const PointQuestion question : {PointQuestion::kInside, PointQuestion::kClosest})
        check(parse_point_request("application/json", body, {}, limits, question));
      break;
    case 5:
      check(parse_vertex_request("application/json", body, {}, limits));
      break;
    case 6:
      check(parse_transaction(body, limits));
      break;
    case 7:
      check(parse_pose_request(body, {}, limits));
      break;
    case 8:
      check(parse_weights_request(0, body, {}, limits));
      break;
    case 9:
      check(parse_render_request(body, "*/*", limits));
      break;
    case 10:
      check(parse_move_instances("application/json", body, limits));
      check(parse_change_instance(body, limits));
      break;
    case 11:
      check(parse_tradeoff_request(body, 2, limits));
      break;
    case 12:
      check_pairs(body, limits);
      break;
    case 13:
      check(parse_sensor_request(body, {}, limits));
      break;
    case 14:
      check(parse_explain_request(body, {}, limits));
      break;
    default:
      check(parse_add_instance(body, limits));
      break;
  }
  return 0;
}
