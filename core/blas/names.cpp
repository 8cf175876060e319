// Names of the structures and splits on the wire and on the command line.

#include <array>
#include <utility>

#include "core/blas/blas.h"

namespace gridcast::blas {
namespace {

template <class Enum, std::size_t kCount>
using Names = std::array<std::pair<Enum, std::string_view>, kCount>;

constexpr Names<StructureKind, 7> kStructureNames{{{StructureKind::kAuto, "auto"},
                                                   {StructureKind::kBruteForce, "brute_force"},
                                                   {StructureKind::kBvh, "bvh"},
                                                   {StructureKind::kWideBvh, "wide_bvh"},
                                                   {StructureKind::kCompactBvh, "compact_bvh"},
                                                   {StructureKind::kKdTree, "kd_tree"},
                                                   {StructureKind::kEmbree, "embree"}}};
constexpr Names<BvhSplit, 3> kSplitNames{
    {{BvhSplit::kMidpoint, "midpoint"}, {BvhSplit::kMedian, "median"}, {BvhSplit::kBinnedSah, "sah"}}};

constexpr Names<SpatialSplits, 2> kSpatialNames{
    {{SpatialSplits::kAuto, "auto"}, {SpatialSplits::kNever, "never"}}};

constexpr Names<BuildQuality, 2> kQualityNames{
    {{BuildQuality::kDefault, "default"}, {BuildQuality::kFast, "fast"}}};

template <class Enum, std::size_t kCount>
std::string_view name_of(const Names<Enum, kCount>& names, Enum value) {
  for (const auto& [known, name] : names)
    if (known == value) return name;
  return "unknown";
}

template <class Enum, std::size_t kCount>
Result<Enum> parse(const Names<Enum, kCount>& names, std::string_view text, const char* what) {
  std::string message = "'";
  message.append(text.substr(0, 40)).append("' is not a ").append(what).append("; valid names:");
  const char* separator = " ";
  for (const auto& [value, name] : names) {
    if (name == text) return value;
    message.append(separator).append(name);
    separator = ", ";
  }
  return Error{ErrorCode::kInvalidArgument, std::move(message), {}};
}

}  // namespace

std::string_view to_string(StructureKind kind) {
  return name_of(kStructureNames, kind);
}

Result<StructureKind> parse_structure_kind(std::string_view name) {
  return parse(kStructureNames, name, "structure");
}

std::string_view to_string(BvhSplit split) {
  return name_of(kSplitNames, split);
}

Result<BvhSplit> parse_bvh_split(std::string_view name) {
  return parse(kSplitNames, name, "BVH split");
}

std::string_view to_string(SpatialSplits spatial) {
  return name_of(kSpatialNames, spatial);
}

Result<SpatialSplits> parse_spatial_splits(std::string_view name) {
  return parse(kSpatialNames, name, "choice of spatial splits");
}

std::string_view to_string(BuildQuality quality) {
  return name_of(kQualityNames, quality);
}

Result<BuildQuality> parse_build_quality(std::string_view name) {
  return parse(kQualityNames, name, "build quality");
}

}  // namespace gridcast::blas
