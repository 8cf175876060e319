#include "core/mesh/deformation.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace gridcast::mesh {
namespace {

Error invalid(std::string message, std::string where) {
  return {ErrorCode::kInvalidArgument, std::move(message), std::move(where)};
}

bool all_finite(const std::vector<Vec3f>& values) {
  return std::all_of(values.begin(), values.end(), [](const Vec3f& v) { return is_finite(v); });
}

Status validate_target(const MorphTarget& target, std::size_t vertex_count, const std::string& where) {
  const auto& ids = target.vertex_ids;
  const std::size_t expected = ids.empty() ? vertex_count : ids.size();
  if (!ids.empty() && (ids.back() >= vertex_count ||
                       std::adjacent_find(ids.begin(), ids.end(), std::greater_equal<>()) != ids.end()))
    return invalid("the vertices of a morph target must be in range and ascending", where + "/vertex_ids");
  if (!target.positions.empty() && target.positions.size() != expected)
    return invalid("a morph target must have one displacement per vertex", where + "/positions");
  if (!target.normals.empty() && target.normals.size() != expected)
    return invalid("a morph target must have one normal per vertex", where + "/normals");
  if (!all_finite(target.positions)) return invalid("a displacement is not finite", where + "/positions");
  return ok_status();
}

Vec3f element(const std::vector<Vec3f>& values, std::size_t i) {
  return values.empty() ? Vec3f(0.F) : values[i];
}

void keep(std::vector<Vec3f>& values, const std::vector<std::uint32_t>& ids) {
  if (values.empty()) return;
  std::vector<Vec3f> kept;
  kept.reserve(ids.size());
  for (const std::uint32_t id : ids) kept.push_back(values[id]);
  values = std::move(kept);
}

}  // namespace

std::size_t MeshDeformation::memory_bytes() const {
  std::size_t bytes = default_weights.capacity() * sizeof(float) + joints.capacity() * sizeof(joints[0]) +
                      weights.capacity() * sizeof(float) + morph_targets.capacity() * sizeof(MorphTarget);
  for (const MorphTarget& target : morph_targets) {
    bytes += (target.positions.capacity() + target.normals.capacity()) * sizeof(Vec3f) +
             target.vertex_ids.capacity() * sizeof(std::uint32_t);
  }
  return bytes;
}

Status validate(const MeshDeformation& deformation, std::size_t vertex_count) {
  for (std::size_t t = 0; t < deformation.morph_targets.size(); ++t) {
    const std::string where = "/morph_targets/" + std::to_string(t);
    if (Status status = validate_target(deformation.morph_targets[t], vertex_count, where); !status)
      return status;
  }
  if (deformation.default_weights.size() > deformation.morph_targets.size())
    return invalid("there are more weights than morph targets", "/default_weights");
  const std::uint32_t influences = deformation.influences;
  if (influences != 0 && influences != 4 && influences != 8)
    return invalid("a vertex follows 0, 4 or 8 joints", "/influences");
  if (deformation.joints.size() != influences * vertex_count)
    return invalid("there must be one joint per influence of a vertex", "/joints");
  if (deformation.weights.size() != influences * vertex_count)
    return invalid("there must be one weight per influence of a vertex", "/weights");
  const auto finite = [](float weight) { return std::isfinite(weight); };
  if (!std::ranges::all_of(deformation.weights, finite))
    return invalid("a joint weight is not finite", "/weights");
  if (!std::ranges::all_of(deformation.default_weights, finite))
    return invalid("a morph weight is not finite", "/default_weights");
  return ok_status();
}

void make_sparse(MorphTarget& target) {
  const std::size_t count = std::max(target.positions.size(), target.normals.size());
  if (!target.vertex_ids.empty() || count == 0) return;
  std::vector<std::uint32_t> moving;
  for (std::size_t i = 0; i < count; ++i) {
    if (element(target.positions, i) != Vec3f(0.F) || element(target.normals, i) != Vec3f(0.F))
      moving.push_back(std::uint32_t(i));
  }
  // A sparse entry has its id beside 12 or 24 bytes of displacements.
  const std::size_t entry_bytes =
      (target.positions.empty() ? 0 : sizeof(Vec3f)) + (target.normals.empty() ? 0 : sizeof(Vec3f));
  if (moving.size() * (entry_bytes + sizeof(std::uint32_t)) >= count * entry_bytes) return;
  if (moving.empty()) {
    target = MorphTarget{};
    return;
  }
  keep(target.positions, moving);
  keep(target.normals, moving);
  target.vertex_ids = std::move(moving);
}

std::uint32_t largest_joint(const MeshDeformation& deformation) {
  const auto& joints = deformation.joints;
  return joints.empty() ? kInvalidId : std::uint32_t(*std::max_element(joints.begin(), joints.end()));
}

}  // namespace gridcast::mesh
