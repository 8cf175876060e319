#include "tests/support/pose_reference.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "tests/support/deform_reference.h"

namespace gridcast::test {
namespace {

using Wide = long double;

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

WideMatrix world_of(const scene::SceneData& data, const ReferencePose& pose, std::uint32_t node) {
  WideMatrix world = pose.locals[node];
  for (std::uint32_t up = data.nodes[node].parent; up != kInvalidId; up = data.nodes[up].parent)
    world = product(pose.locals[up], world);
  return world;
}

std::vector<double> weights_of(const scene::SceneData& data, const ReferencePose& pose,
                               const scene::InstanceData& instance) {
  const auto& deformation = data.deformations[instance.mesh_id];
  std::vector<double> weights(deformation.default_weights.begin(), deformation.default_weights.end());
  if (instance.node != kInvalidId && !pose.weights[instance.node].empty())
    weights = pose.weights[instance.node];
  weights.resize(deformation.morph_targets.size(), 0.0);
  return weights;
}

WideMatrix place_of(const scene::SceneData& data, const ReferencePose& pose,
                    const scene::InstanceData& instance) {
  if (instance.node == kInvalidId) return widen(instance.world_from_object);
  const WideMatrix world = world_of(data, pose, instance.node);
  return instance.entry == kInvalidId ? world : product(world, widen(data.entries[instance.entry]));
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

/// A node's translation, rotation (x, y, z, w) and scale.
struct WideTrs {
  std::array<Wide, 3> t{};
  std::array<Wide, 4> r{0, 0, 0, 1};
  std::array<Wide, 3> s{1, 1, 1};
};

WideMatrix matrix_of(const WideTrs& trs) {
  const Wide length =
      std::sqrt(trs.r[0] * trs.r[0] + trs.r[1] * trs.r[1] + trs.r[2] * trs.r[2] + trs.r[3] * trs.r[3]);
  const Wide x = trs.r[0] / length, y = trs.r[1] / length, z = trs.r[2] / length, w = trs.r[3] / length;
  WideMatrix m;
  m.rows[0] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), trs.t[0]};
  m.rows[1] = {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), trs.t[1]};
  m.rows[2] = {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), trs.t[2]};
  for (auto& row : m.rows)
    for (std::size_t axis = 0; axis < 3; ++axis) row[axis] *= trs.s[axis];
  return m;
}

/// Spherical interpolation on the shorter arc, by the angle's tangent.
std::vector<Wide> slerp(const std::vector<Wide>& a, std::vector<Wide> b, Wide share) {
  Wide cosine = 0, far = 0, near = 0;
  for (std::size_t i = 0; i < 4; ++i) cosine += a[i] * b[i];
  for (Wide& part : b) part *= cosine < 0 ? -1 : 1;
  for (std::size_t i = 0; i < 4; ++i) {
    far += (a[i] - b[i]) * (a[i] - b[i]);
    near += (a[i] + b[i]) * (a[i] + b[i]);
  }
  const Wide angle = 2 * std::atan2(std::sqrt(far), std::sqrt(near));
  std::vector<Wide> out(4);
  for (std::size_t i = 0; i < 4; ++i)
    out[i] = angle == 0
                 ? a[i]
                 : (std::sin((1 - share) * angle) * a[i] + std::sin(share * angle) * b[i]) / std::sin(angle);
  return out;
}

std::vector<Wide> unit(std::vector<Wide> q) {
  Wide square = 0;
  for (const Wide part : q) square += part * part;
  for (Wide& part : q) part /= std::sqrt(square);
  return q;
}

std::vector<Wide> sampled(const scene::AnimationChannel& channel, Wide time_s) {
  using scene::Interpolation;
  const std::size_t keys = channel.times_s.size();
  const std::size_t rows = channel.interpolation == Interpolation::kCubicSpline ? 3 : 1;
  const std::size_t width = channel.values.size() / (rows * keys);
  const auto row = [&](std::size_t key, std::size_t which) {
    const auto first = channel.values.begin() + std::ptrdiff_t((rows * key + which) * width);
    return std::vector<Wide>(first, first + std::ptrdiff_t(width));
  };
  std::size_t key = 0;
  while (key + 1 < keys && Wide(channel.times_s[key + 1]) <= time_s) ++key;
  const bool turns = channel.path == scene::AnimationPath::kRotation;
  const std::vector<Wide> from = row(key, rows / 2);
  if (key + 1 == keys || time_s <= Wide(channel.times_s[key]) ||
      channel.interpolation == Interpolation::kStep)
    return from;
  const std::vector<Wide> to = row(key + 1, rows / 2);
  const Wide length = Wide(channel.times_s[key + 1]) - Wide(channel.times_s[key]);
  const Wide u = (time_s - Wide(channel.times_s[key])) / length;
  if (channel.interpolation == Interpolation::kLinear && turns) return slerp(unit(from), unit(to), u);
  std::vector<Wide> out(width);
  for (std::size_t i = 0; i < width; ++i) {
    out[i] = (1 - u) * from[i] + u * to[i];
    if (channel.interpolation == Interpolation::kLinear) continue;
    const Wide leave = length * row(key, 2)[i], arrive = length * row(key + 1, 0)[i];
    out[i] = (2 * u * u * u - 3 * u * u + 1) * from[i] + (u * u * u - 2 * u * u + u) * leave +
             (-2 * u * u * u + 3 * u * u) * to[i] + (u * u * u - u * u) * arrive;
  }
  return out;
}

}  // namespace

ReferencePose reference_rest_pose(const scene::SceneData& data) {
  ReferencePose pose;
  for (const scene::Node& node : data.nodes) {
    pose.locals.push_back(widen(node.local));
    pose.weights.emplace_back(node.weights.begin(), node.weights.end());
  }
  return pose;
}

ReferencePose reference_animated(const scene::SceneData& data, std::size_t animation_id, long double time_s) {
  ReferencePose pose = reference_rest_pose(data);
  std::map<std::uint32_t, WideTrs> moved;
  for (const scene::AnimationChannel& channel : data.animations[animation_id].channels) {
    const std::vector<Wide> value = sampled(channel, time_s);
    if (channel.path == scene::AnimationPath::kWeights) {
      pose.weights[channel.node].assign(value.begin(), value.end());
      continue;
    }
    const Trs& rest = data.nodes[channel.node].trs;
    const auto [entry, is_new] = moved.try_emplace(channel.node);
    WideTrs& trs = entry->second;
    for (std::size_t axis = 0; is_new && axis < 3; ++axis) {
      trs.t[axis] = rest.translation[int(axis)];
      trs.s[axis] = rest.scale[int(axis)];
    }
    if (is_new) std::copy(rest.rotation.begin(), rest.rotation.end(), trs.r.begin());
    if (channel.path == scene::AnimationPath::kTranslation)
      std::copy(value.begin(), value.end(), trs.t.begin());
    if (channel.path == scene::AnimationPath::kRotation) std::copy(value.begin(), value.end(), trs.r.begin());
    if (channel.path == scene::AnimationPath::kScale) std::copy(value.begin(), value.end(), trs.s.begin());
  }
  for (const auto& [node, trs] : moved) pose.locals[node] = matrix_of(trs);
  return pose;
}

std::vector<WidePoint> reference_points(const scene::SceneData& data, const ReferencePose& pose,
                                        std::size_t instance_id) {
  const scene::InstanceData& instance = data.instances[instance_id];
  const mesh::TriangleMesh& mesh = *data.meshes[instance.mesh_id];
  const auto& deformation = data.deformations[instance.mesh_id];
  const std::vector<double> weights = weights_of(data, pose, instance);
  std::vector<WideMatrix> joints;
  if (instance.skin_id != kInvalidId && deformation.influences != 0) {
    const scene::Skin& skin = data.skins[instance.skin_id];
    for (std::size_t j = 0; j < skin.joints.size(); ++j)
      joints.push_back(product(world_of(data, pose, skin.joints[j]), widen(skin.inverse_bind[j])));
  }
  const WideMatrix place = place_of(data, pose, instance);
  std::vector<WidePoint> points;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const WidePoint morphed = reference_position(mesh, deformation, weights, {}, v).position;
    points.push_back(joints.empty() ? image(place, morphed) : skinned(deformation, joints, morphed, v));
  }
  return points;
}

std::vector<WidePoint> reference_rest(const scene::SceneData& data, std::size_t instance_id) {
  return reference_points(data, reference_rest_pose(data), instance_id);
}

}  // namespace gridcast::test
