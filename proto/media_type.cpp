#include "proto/media_type.h"

#include <algorithm>
#include <cstdlib>

namespace gridcast::proto {
namespace {

bool is_token_char(char c) {
  constexpr std::string_view kMarks = "!#$%&'*+-.^_`|~";
  return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
         kMarks.find(c) != std::string_view::npos;
}
char lower(char c) {
  return c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
}

/// Reads a header from the left; every take_ leaves the rest in place when it does not fit.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : text_(text) {}
  [[nodiscard]] bool done() const { return text_.empty(); }
  void skip_space() {
    while (!text_.empty() && (text_.front() == ' ' || text_.front() == '\t')) text_.remove_prefix(1);
  }
  bool take(char c) {
    if (text_.empty() || text_.front() != c) return false;
    text_.remove_prefix(1);
    return true;
  }
  std::string_view take_token() {
    std::size_t n = 0;
    while (n < text_.size() && is_token_char(text_[n])) ++n;
    const std::string_view token = text_.substr(0, n);
    text_.remove_prefix(n);
    return token;
  }
  /// After the opening quote; nothing when it is not closed.
  std::optional<std::string> take_quoted() {
    std::string value;
    while (!text_.empty()) {
      char c = text_.front();
      text_.remove_prefix(1);
      if (c == '"') return value;
      if (c == '\\' && !text_.empty()) {
        c = text_.front();
        text_.remove_prefix(1);
      }
      value += c;
    }
    return std::nullopt;
  }

 private:
  std::string_view text_;
};

std::string lower(std::string_view text) {
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(), [](char c) { return lower(c); });
  return result;
}

bool scan_parameter(Scanner& scanner, MediaType& type) {
  const std::string name = lower(scanner.take_token());
  if (name.empty() || !scanner.take('=') || type.find(name) != nullptr) return false;
  std::string value;
  if (scanner.take('"')) {
    auto quoted = scanner.take_quoted();
    if (!quoted) return false;
    value = std::move(*quoted);
  } else {
    value = scanner.take_token();
    if (value.empty()) return false;
  }
  type.parameters.emplace_back(name, std::move(value));
  return true;
}

/// A media type or range, up to a comma or the end.
std::optional<MediaType> scan_media_type(Scanner& scanner) {
  MediaType type;
  scanner.skip_space();
  const std::string main = lower(scanner.take_token());
  if (main.empty() || !scanner.take('/')) return std::nullopt;
  const std::string sub = lower(scanner.take_token());
  if (sub.empty()) return std::nullopt;
  type.essence = main + "/" + sub;
  scanner.skip_space();
  while (scanner.take(';')) {
    scanner.skip_space();
    if (!scan_parameter(scanner, type)) return std::nullopt;
    scanner.skip_space();
  }
  return type;
}

/// How exactly a range names a type: 0 not at all, 1 by */*, 2 by type/*, 3 in full.
int specificity(std::string_view range, std::string_view type) {
  if (range == type) return 3;
  if (range == "*/*") return 1;
  const std::size_t slash = type.find('/');
  return range.ends_with("/*") && range.substr(0, range.size() - 1) == type.substr(0, slash + 1) ? 2 : 0;
}

double quality(const MediaType& range) {
  const std::string* q = range.find("q");
  if (q == nullptr) return 1.0;
  char* end = nullptr;
  const double value = std::strtod(q->c_str(), &end);
  return end == q->c_str() + q->size() && value >= 0.0 && value <= 1.0 ? value : 0.0;
}

}  // namespace

const std::string* MediaType::find(std::string_view name) const {
  for (const auto& [key, value] : parameters)
    if (key == name) return &value;
  return nullptr;
}

std::optional<MediaType> parse_media_type(std::string_view header) {
  Scanner scanner(header);
  auto type = scan_media_type(scanner);
  if (!type || !scanner.done()) return std::nullopt;
  return type;
}

std::optional<std::size_t> negotiate(std::string_view accept, std::span<const std::string_view> offered) {
  Scanner scanner(accept);
  scanner.skip_space();
  if (scanner.done()) return 0;
  // For each offer the most specific range that names it decides its quality.
  std::vector<int> best_specificity(offered.size(), 0);
  std::vector<double> best_quality(offered.size(), 0.0);
  do {
    const auto range = scan_media_type(scanner);
    if (!range) break;
    for (std::size_t i = 0; i < offered.size(); ++i) {
      const int fit = specificity(range->essence, offered[i]);
      if (fit <= best_specificity[i]) continue;
      best_specificity[i] = fit;
      best_quality[i] = quality(*range);
    }
  } while (scanner.take(','));
  const auto best = std::max_element(best_quality.begin(), best_quality.end());
  if (best == best_quality.end() || *best <= 0.0) return std::nullopt;
  return std::size_t(best - best_quality.begin());
}

}  // namespace gridcast::proto
