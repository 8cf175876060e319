// Heads of requests: what is accepted is unambiguous and within the limits.

#include "server/http/http_head.h"
#include "tests/fuzz/fuzz_input.h"

using namespace gridcast;

namespace {

bool is_visible(std::string_view text, bool spaces) {
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte == '\t' || byte == ' ' ? !spaces : byte < 0x21 || byte == 0x7F) return false;
  }
  return true;
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using server::BodyFraming;
  const auto parsed = server::parse_head({reinterpret_cast<const char*>(data), size});
  if (const auto* error = std::get_if<server::HeadError>(&parsed)) {
    fuzz::require(!error->detail.empty(), "a refusal says nothing");
    return 0;
  }
  const auto& head = std::get<server::HttpHead>(parsed);
  fuzz::require(size <= server::kMaxHeadBytes, "a head is too long");
  fuzz::require(head.headers.size() <= server::kMaxHeaders, "there are too many headers");
  fuzz::require(head.target.size() <= server::kMaxTargetBytes, "the target is too long");
  fuzz::require(!head.target.empty() && is_visible(head.target, false), "the target holds odd characters");
  fuzz::require(!head.method.empty() && is_visible(head.method, false), "the method holds odd characters");
  std::size_t lengths = 0, codings = 0;
  for (const auto& [name, value] : head.headers) {
    fuzz::require(!name.empty() && is_visible(name, false), "a header's name holds odd characters");
    fuzz::require(is_visible(value, true), "a header's value holds control characters");
    lengths += name == "content-length" ? 1 : 0;
    codings += name == "transfer-encoding" ? 1 : 0;
  }
  fuzz::require(lengths <= 1 && codings <= 1 && lengths + codings <= 1, "the framing is ambiguous");
  fuzz::require((head.framing == BodyFraming::kLength) == (lengths == 1), "the length is not heeded");
  fuzz::require((head.framing == BodyFraming::kChunked) == (codings == 1), "the coding is not heeded");
  return 0;
}
