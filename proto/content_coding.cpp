#include "proto/content_coding.h"

#include <algorithm>
#include <cstdlib>
#include <string>

#include "proto/header_text.h"

namespace gridcast::proto {
namespace {

/// `0`, `0.25`, `1.000`: a digit, and at most three behind a point.
std::optional<double> read_weight(std::string_view text) {
  const bool shaped =
      !text.empty() && text.size() <= 5 && (text[0] == '0' || text[0] == '1') &&
      (text.size() == 1 || text[1] == '.') &&
      text.find_first_not_of("0123456789", std::min<std::size_t>(2, text.size())) == text.npos;
  if (!shaped) return std::nullopt;
  const double weight = std::strtod(std::string(text).c_str(), nullptr);
  return weight <= 1.0 ? std::optional(weight) : std::nullopt;
}

struct WeightedCoding {
  std::string coding;
  double weight = 1.0;
};

/// `zstd` or `zstd;q=0.5`.
std::optional<WeightedCoding> read_item(std::string_view item) {
  const std::size_t semicolon = std::min(item.find(';'), item.size());
  WeightedCoding read{lower_case(trimmed(item.substr(0, semicolon)))};
  if (read.coding.empty() || read.coding.find_first_of(" \t=\"") != std::string::npos) return std::nullopt;
  if (semicolon == item.size()) return read;
  const std::string parameter = lower_case(trimmed(item.substr(semicolon + 1)));
  if (!parameter.starts_with("q=")) return std::nullopt;
  const auto weight = read_weight(std::string_view(parameter).substr(2));
  if (!weight) return std::nullopt;
  read.weight = *weight;
  return read;
}

}  // namespace

std::optional<BodyCoding> parse_content_encoding(std::string_view header) {
  const std::string coding = lower_case(trimmed(header));
  if (coding.empty() || coding == "identity") return BodyCoding::kIdentity;
  if (coding == kZstdCoding) return BodyCoding::kZstd;
  return std::nullopt;
}

AnswerCoding choose_answer_coding(std::string_view accept_encoding) {
  std::optional<double> zstd, identity, others;
  while (!accept_encoding.empty()) {
    const std::size_t comma = std::min(accept_encoding.find(','), accept_encoding.size());
    const std::string_view item = trimmed(accept_encoding.substr(0, comma));
    accept_encoding.remove_prefix(std::min(comma + 1, accept_encoding.size()));
    if (item.empty()) continue;
    const auto read = read_item(item);
    if (!read) return AnswerCoding::kIdentity;
    if (read->coding == kZstdCoding) zstd = read->weight;
    if (read->coding == "identity") identity = read->weight;
    if (read->coding == "*") others = read->weight;
  }
  const double zstd_weight = zstd.value_or(others.value_or(0.0));
  // Identity is refused by name, or by "*;q=0"; else it is always taken.
  const bool takes_identity = identity.value_or(others.value_or(1.0)) > 0.0;
  if (zstd_weight <= 0.0) return takes_identity ? AnswerCoding::kIdentity : AnswerCoding::kNone;
  if (!takes_identity) return AnswerCoding::kZstdOnly;
  return identity && *identity > zstd_weight ? AnswerCoding::kIdentity : AnswerCoding::kZstd;
}

}  // namespace gridcast::proto
