#include "tests/support/pose_reference.h"

#include "tests/support/deform_reference.h"

namespace gridcast::test {
namespace {

using Wide = long double;

/// Row-major 3 x 4.
struct WideMatrix {
  std::array<std::array<Wide, 4>, 3> rows{};
};

WideMatrix widen(const Affine& affine) {
  WideMatrix m;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) m.rows[std::size_t(r)][std::size_t(c)] = Wide(affine.linear[c][r]);
    m.rows[std::size_t(r)][3] = Wide(affine.translation[r]);
  }
  return m;
}

WideMatrix product(const WideMatrix& a, const WideMatrix& b) {
  WideMatrix m;
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 4; ++c) {
      m.rows[r][c] = c == 3 ? a.rows[r][3] : 0;
      for (std::size_t k = 0; k < 3; ++k) m.rows[r][c] += a.rows[r][k] * b.rows[k][c];
    }
  }
  return m;
}

WidePoint image(const WideMatrix& m, const WidePoint& p) {
  WidePoint out{};
  for (std::size_t r = 0; r < 3; ++r)
    out[r] = m.rows[r][0] * p[0] + m.rows[r][1] * p[1] + m.rows[r][2] * p[2] + m.rows[r][3];
  return out;
}

WideMatrix world_of(const scene::SceneData& data, std::uint32_t node) {
  WideMatrix world = widen(data.nodes[node].local);
  for (std::uint32_t up = data.nodes[node].parent; up != kInvalidId; up = data.nodes[up].parent)
    world = product(widen(data.nodes[up].local), world);
  return world;
}

std::vector<float> weights_of(const scene::SceneData& data, const scene::InstanceData& instance) {
  const auto& deformation = data.deformations[instance.mesh_id];
  std::vector<float> weights = deformation.default_weights;
  if (instance.node != kInvalidId && !data.nodes[instance.node].weights.empty())
    weights = data.nodes[instance.node].weights;
  weights.resize(deformation.morph_targets.size(), 0.F);
  return weights;
}

WidePoint skinned(const mesh::MeshDeformation& deformation, const std::vector<WideMatrix>& joints,
                  const WidePoint& p, std::size_t vertex) {
  const std::uint32_t n = deformation.influences;
  Wide total = 0;
  WidePoint sum{};
  for (std::uint32_t k = 0; k < n; ++k) {
    const Wide weight = Wide(deformation.weights[n * vertex + k]);
    const WidePoint moved = image(joints[deformation.joints[n * vertex + k]], p);
    for (std::size_t axis = 0; axis < 3; ++axis) sum[axis] += weight * moved[axis];
    total += weight;
  }
  if (!(total > 0)) return image(joints[deformation.joints[n * vertex]], p);
  for (Wide& value : sum) value /= total;
  return sum;
}

}  // namespace

std::vector<WidePoint> reference_rest(const scene::SceneData& data, std::size_t instance_id) {
  const scene::InstanceData& instance = data.instances[instance_id];
  const mesh::TriangleMesh& mesh = *data.meshes[instance.mesh_id];
  const auto& deformation = data.deformations[instance.mesh_id];
  const std::vector<float> weights = weights_of(data, instance);
  std::vector<WideMatrix> joints;
  if (instance.skin_id != kInvalidId && deformation.influences != 0) {
    const scene::Skin& skin = data.skins[instance.skin_id];
    for (std::size_t j = 0; j < skin.joints.size(); ++j)
      joints.push_back(product(world_of(data, skin.joints[j]), widen(skin.inverse_bind[j])));
  }
  std::vector<WidePoint> points;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const WidePoint morphed = reference_position(mesh, deformation, weights, {}, v).position;
    points.push_back(joints.empty() ? image(widen(instance.world_from_object), morphed)
                                    : skinned(deformation, joints, morphed, v));
  }
  return points;
}

}  // namespace gridcast::test
