#include "proto/binary_rows.h"

#include <string>

namespace gridcast::proto {

std::optional<Problem> read_binary_rows(const RowKind& kind, const MediaType& type, std::string_view body,
                                        const Limits& limits, ScalarType& scalar,
                                        std::span<const std::byte>& rows) {
  const std::string name(kind.name);
  scalar = ScalarType::kFloat32;
  for (const auto& [parameter, value] : type.parameters) {
    if (parameter != "dtype" || (value != "float32" && value != "float64"))
      return Problem{ProblemCode::kUnsupportedMediaType,
                     std::string(kind.media_type) + " takes dtype=float32|float64", "Content-Type"};
    scalar = value == "float32" ? ScalarType::kFloat32 : ScalarType::kFloat64;
  }
  if (body.size() > limits.binary_bytes)
    return Problem{ProblemCode::kPayloadTooLarge,
                   "binary " + name + " may have at most " + std::to_string(limits.binary_bytes) + " bytes",
                   ""};
  const std::size_t row_bytes = kind.columns * size_bytes(scalar);
  if (body.size() % row_bytes != 0)
    return Problem{
        ProblemCode::kWrongLength,
        "the body is not a whole number of " + name + " of " + std::to_string(row_bytes) + " bytes", ""};
  if (body.size() / row_bytes > limits.binary_rays)
    return Problem{ProblemCode::kTooManyPoints,
                   "one request may have at most " + std::to_string(limits.binary_rays) + " " + name, ""};
  rows = std::as_bytes(std::span(body));
  return std::nullopt;
}

}  // namespace gridcast::proto
