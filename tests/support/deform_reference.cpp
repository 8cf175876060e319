#include "tests/support/deform_reference.h"

#include <cmath>

namespace gridcast::test {
namespace {

using Wide = long double;

/// The displacement of a vertex by a target, dense or sparse.
Vec3f displacement(const mesh::MorphTarget& target, std::size_t vertex) {
  if (target.positions.empty()) return Vec3f(0.F);
  if (target.vertex_ids.empty()) return target.positions[vertex];
  for (std::size_t i = 0; i < target.vertex_ids.size(); ++i)
    if (target.vertex_ids[i] == vertex) return target.positions[i];
  return Vec3f(0.F);
}

}  // namespace

ReferencePoint reference_position(const mesh::TriangleMesh& mesh, const mesh::MeshDeformation& deformation,
                                  std::span<const double> weights, std::span<const Affine> joints,
                                  std::size_t vertex) {
  Wide p[3], size[3];
  for (int axis = 0; axis < 3; ++axis) {
    p[axis] = Wide(mesh.positions[vertex][axis]);
    size[axis] = std::abs(p[axis]);
    for (std::size_t t = 0; t < weights.size(); ++t) {
      const Wide term = Wide(weights[t]) * Wide(displacement(deformation.morph_targets[t], vertex)[axis]);
      p[axis] += term;
      size[axis] += std::abs(term);
    }
  }
  ReferencePoint out{{p[0], p[1], p[2]}, {size[0], size[1], size[2]}};
  const std::uint32_t n = deformation.influences;
  if (joints.empty() || n == 0) return out;

  Wide total = 0;
  for (std::uint32_t k = 0; k < n; ++k) total += Wide(deformation.weights[n * vertex + k]);
  out = {};
  for (std::uint32_t k = 0; k < n; ++k) {
    Wide share = total > 0 ? Wide(deformation.weights[n * vertex + k]) / total : Wide(k == 0 ? 1 : 0);
    const Affine& joint = joints[deformation.joints[n * vertex + k]];
    for (int row = 0; row < 3; ++row) {
      Wide moved = Wide(joint.translation[row]), magnitude = std::abs(moved);
      for (int column = 0; column < 3; ++column) {
        moved += Wide(joint.linear[column][row]) * p[column];
        magnitude += std::abs(Wide(joint.linear[column][row])) * size[column];
      }
      out.position[std::size_t(row)] += share * moved;
      out.magnitude[std::size_t(row)] += std::abs(share) * magnitude;
    }
  }
  return out;
}

}  // namespace gridcast::test
