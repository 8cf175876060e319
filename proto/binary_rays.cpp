#include "proto/binary_rays.h"

#include <cstring>
#include <string>

#include "proto/json_pointer.h"

namespace gridcast::proto {
namespace {

/// What stands before the rows.
enum class Exclusion { kNone, kIds };

struct Layout {
  ScalarType scalar = ScalarType::kFloat32;
  std::size_t columns = 6;
  Exclusion exclude = Exclusion::kNone;

  [[nodiscard]] std::size_t row_bytes() const { return columns * size_bytes(scalar); }
  [[nodiscard]] std::size_t id_bytes() const { return exclude == Exclusion::kIds ? sizeof(PrimitiveRef) : 0; }
  /// Of one ray in all.
  [[nodiscard]] std::size_t ray_bytes() const { return id_bytes() + row_bytes(); }
};

/// Nothing for a parameter that is not known.
std::optional<Layout> read_layout(const MediaType& type) {
  Layout layout;
  for (const auto& [name, value] : type.parameters) {
    if (name == "dtype" && (value == "float32" || value == "float64"))
      layout.scalar = value == "float32" ? ScalarType::kFloat32 : ScalarType::kFloat64;
    else if (name == "columns" && (value == "6" || value == "8"))
      layout.columns = value == "6" ? 6 : 8;
    else if (name == "exclude" && (value == "none" || value == "ids"))
      layout.exclude = value == "none" ? Exclusion::kNone : Exclusion::kIds;
    else
      return std::nullopt;
  }
  return layout;
}

std::optional<Problem> check_size(const Layout& layout, std::size_t body_bytes, const Limits& limits) {
  if (body_bytes > limits.binary_bytes)
    return Problem{ProblemCode::kPayloadTooLarge,
                   "binary rays may have at most " + std::to_string(limits.binary_bytes) + " bytes", ""};
  if (body_bytes % layout.ray_bytes() != 0)
    return Problem{
        ProblemCode::kWrongLength,
        "the body is not a whole number of rays of " + std::to_string(layout.ray_bytes()) + " bytes", ""};
  if (body_bytes / layout.ray_bytes() > limits.binary_rays)
    return Problem{ProblemCode::kTooManyRays,
                   "one request may have at most " + std::to_string(limits.binary_rays) + " rays", ""};
  return std::nullopt;
}

/// As JSON has no id 0xFFFFFFFF, half a reference to nothing is refused here too.
std::optional<Problem> check_excluded(const std::vector<PrimitiveRef>& excluded) {
  for (std::size_t i = 0; i < excluded.size(); ++i) {
    const auto& [instance_id, primitive_id] = excluded[i];
    if ((instance_id == kInvalidId) == (primitive_id == kInvalidId)) continue;
    Problem problem{ProblemCode::kOutOfRange, "0xFFFFFFFF stands for no triangle in both ids or in none",
                    "/exclude"};
    append_pointer(problem.pointer, i);
    return problem;
  }
  return std::nullopt;
}

}  // namespace

std::optional<Problem> check_binary_rays(const MediaType& type, std::size_t body_bytes, const Limits& limits,
                                         RayRequest& request) {
  const auto layout = read_layout(type);
  if (!layout)
    return Problem{
        ProblemCode::kUnsupportedMediaType,
        std::string(kRaysMediaType) + " takes dtype=float32|float64, columns=6|8 and exclude=none|ids",
        "Content-Type"};
  request.scalar = layout->scalar;
  request.columns = layout->columns;
  return check_size(*layout, body_bytes, limits);
}

std::optional<Problem> parse_binary_rays(const MediaType& type, std::string_view body, const Limits& limits,
                                         RayRequest& request) {
  if (auto problem = check_binary_rays(type, body.size(), limits, request)) return problem;
  const Layout layout = *read_layout(type);
  const std::size_t count = body.size() / layout.ray_bytes();
  request.binary_body = std::as_bytes(std::span(body)).subspan(count * layout.id_bytes());
  if (layout.exclude == Exclusion::kNone) return std::nullopt;
  static_assert(sizeof(PrimitiveRef) == 2 * sizeof(std::uint32_t));
  request.excluded.resize(count);
  if (count > 0) std::memcpy(request.excluded.data(), body.data(), count * sizeof(PrimitiveRef));
  return check_excluded(request.excluded);
}

}  // namespace gridcast::proto
