// Packed bodies: the first byte says how many bytes come at once, the second how large they may get. What is
// decoded does not depend on the pieces, and what is accepted can be packed and unpacked again.

#include <string>

#include "proto/zstd.h"
#include "tests/fuzz/fuzz_input.h"

using namespace gridcast;

namespace {

struct Outcome {
  bool ok = false;
  std::string body;
};

Outcome decode(std::string_view encoded, std::size_t step, std::size_t max_bytes) {
  Outcome outcome;
  proto::ZstdDecoder decoder(max_bytes);
  const auto take = [&](std::string_view part) {
    fuzz::require(!part.empty(), "nothing is handed over");
    outcome.body.append(part);
    fuzz::require(outcome.body.size() <= max_bytes, "the limit does not hold");
    return std::optional<proto::Problem>();
  };
  std::optional<proto::Problem> problem;
  while (!problem && !encoded.empty()) {
    problem = decoder.decode(encoded.substr(0, step), take);
    encoded.remove_prefix(std::min(step, encoded.size()));
  }
  if (!problem) problem = decoder.finish();
  if (problem) {
    fuzz::require(problem->status() == 400 || problem->status() == 413, "a refusal blames the server");
    fuzz::require(!problem->detail.empty(), "a refusal says nothing");
  }
  outcome.ok = !problem;
  return outcome;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::FuzzInput input(data, size);
  const std::size_t step = std::size_t(1) + input.byte();
  const std::size_t max_bytes = std::size_t(1) << input.below(22);
  const Outcome whole = decode(input.text(), input.text().size() + 1, max_bytes);
  const Outcome pieces = decode(input.text(), step, max_bytes);
  fuzz::require(whole.ok == pieces.ok, "what is accepted depends on the pieces");
  if (!whole.ok) return 0;
  fuzz::require(whole.body == pieces.body, "what is decoded depends on the pieces");
  const auto packed = proto::encode_zstd(whole.body, std::stop_token());
  fuzz::require(packed.has_value() && decode(*packed, step, max_bytes).body == whole.body,
                "packing loses something");
  return 0;
}
