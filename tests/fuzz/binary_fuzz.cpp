// Bodies in binary: the first byte is the length of the media type, then that, then the body.

#include <string>

#include "proto/point_request.h"
#include "proto/ray_request.h"
#include "proto/scene_request.h"
#include "proto/vertex_request.h"
#include "proto/visibility_request.h"
#include "tests/fuzz/fuzz_input.h"

using namespace gridcast;

namespace {

template <class T>
bool check(const proto::Parsed<T>& parsed) {
  if (!parsed.ok()) {
    fuzz::require(parsed.problem().status() < 500, "a refusal blames the server");
    fuzz::require(!parsed.problem().detail.empty(), "a refusal says nothing");
  }
  return parsed.ok();
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace gridcast::proto;
  fuzz::FuzzInput input(data, size);
  const std::size_t named = input.byte(), length = std::min(named, input.text().size());
  const std::string_view type = input.text().substr(0, length), body = input.text().substr(length);
  const Limits limits;
  for (const RayQuestion question :
       {RayQuestion::kClosest, RayQuestion::kAny, RayQuestion::kAll, RayQuestion::kCount}) {
    const auto rays = parse_ray_request(type, body, {}, limits, question);
    if (!check(rays)) continue;
    const RayBatch batch = rays.value().batch();
    for (std::size_t i = 0; i < batch.size(); ++i) (void)is_valid(batch[i]);
  }
  const auto points = parse_point_request(type, body, {}, limits, PointQuestion::kClosest);
  if (check(points)) {
    const PointBatch batch = points.value().batch();
    for (std::size_t i = 0; i < batch.size(); ++i) (void)batch[i];
  }
  const auto pairs = parse_visibility_request(type, body, {}, limits);
  if (check(pairs)) {
    const PairBatch batch = pairs.value().batch();
    for (std::size_t i = 0; i < batch.size(); ++i) (void)batch.from(i), (void)batch.to(i);
  }
  check(parse_move_instances(type, body, limits));
  check(parse_vertex_request(type, body, {}, limits));
  return 0;
}
