#include "proto/etag.h"

namespace gridcast::proto {

std::string etag(std::uint64_t version) {
  return '"' + std::to_string(version) + '"';
}

namespace {
constexpr std::string_view kPackedEnd = "-zstd";

std::string_view without_end(std::string_view tag) {
  if (tag.ends_with(kPackedEnd)) tag.remove_suffix(kPackedEnd.size());
  return tag;
}

void skip_space(std::string_view& text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
}
}  // namespace

std::string packed_etag(std::string_view tag) {
  std::string packed(tag);
  return packed.insert(packed.size() - 1, kPackedEnd);
}

bool has_packed_etag(std::string_view header) {
  return header.find(std::string(kPackedEnd) + '"') != std::string_view::npos;
}

TagMatch match_etag(std::string_view header, std::uint64_t version, TagComparison comparison) {
  const std::string wanted = std::to_string(version);
  std::string_view rest = header;
  skip_space(rest);
  if (rest == "*") return TagMatch::kMatches;
  TagMatch result = TagMatch::kDiffers;
  while (true) {
    const bool weak = rest.starts_with("W/");
    if (weak) rest.remove_prefix(2);
    if (!rest.starts_with('"')) return TagMatch::kMalformed;
    const std::size_t close = rest.find('"', 1);
    if (close == std::string_view::npos) return TagMatch::kMalformed;
    const bool counts = !weak || comparison == TagComparison::kWeak;
    if (counts && without_end(rest.substr(1, close - 1)) == wanted) result = TagMatch::kMatches;
    rest.remove_prefix(close + 1);
    skip_space(rest);
    if (rest.empty()) return result;
    if (rest.front() != ',') return TagMatch::kMalformed;
    rest.remove_prefix(1);
    skip_space(rest);
  }
}

}  // namespace gridcast::proto
