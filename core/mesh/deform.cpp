#include "core/mesh/deform.h"

#include <algorithm>
#include <array>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace gridcast::mesh {
namespace {

/// Vertices that are morphed and skinned while their doubles are in the first cache.
constexpr std::size_t kBlock = 256;
/// Blocks per task.
constexpr std::size_t kBlocksPerTask = 16;

/// The images of the axes and of the origin, padded to four lanes so that the compiler fills its registers.
struct JointMatrix {
  double columns[16];
};

JointMatrix pad(const Affine& affine) {
  JointMatrix matrix{};
  for (int c = 0; c < 4; ++c) {
    const Vec3d& column = c < 3 ? affine.linear[c] : affine.translation;
    for (int r = 0; r < 3; ++r) matrix.columns[4 * c + r] = column[r];
  }
  return matrix;
}

/// The vertices [begin, end) as doubles, three to a vertex.
struct Block {
  std::size_t begin, end;
  std::array<double, 3 * kBlock> values;

  void load(const std::vector<Vec3f>& from) {
    const float* source = &from[begin].x;
    for (std::size_t i = 0; i < 3 * (end - begin); ++i) values[i] = double(source[i]);
  }

  void add(double weight, const std::vector<Vec3f>& displacements, const std::vector<std::uint32_t>& ids) {
    if (displacements.empty() || weight == 0.0) return;
    if (ids.empty()) {
      const float* source = &displacements[begin].x;
      for (std::size_t i = 0; i < 3 * (end - begin); ++i) values[i] += weight * double(source[i]);
      return;
    }
    auto id = std::lower_bound(ids.begin(), ids.end(), begin);
    for (; id != ids.end() && *id < end; ++id) {
      const Vec3f& displacement = displacements[std::size_t(id - ids.begin())];
      double* to = &values[3 * (*id - begin)];
      for (int axis = 0; axis < 3; ++axis) to[axis] += weight * double(component(displacement, axis));
    }
  }

  [[nodiscard]] Vec3d at(std::size_t vertex) const {
    const double* from = &values[3 * (vertex - begin)];
    return {from[0], from[1], from[2]};
  }
};

Vec3d column(const JointMatrix& matrix, std::size_t c) {
  const double* from = &matrix.columns[4 * c];
  return {from[0], from[1], from[2]};
}

/// `normal` turned as the surface turns, unit. A direction that vanishes is that of `otherwise`.
Vec3f turn_normal(const JointMatrix& matrix, const Vec3d& normal, const Vec3f& otherwise) {
  const Vec3d x = column(matrix, 0), y = column(matrix, 1), z = column(matrix, 2);
  const Vec3d turned = normal.x * cross(y, z) + normal.y * cross(z, x) + normal.z * cross(x, y);
  const double largest = max_abs(turned);
  if (!(largest > 0.0) || !is_finite(turned)) return otherwise;
  return Vec3f(glm::normalize(turned / largest));
}

class Deformer {
 public:
  Deformer(const TriangleMesh& mesh, const MeshDeformation& deformation, std::span<const double> weights,
           std::span<const Affine> joints)
      : mesh_(mesh), deformation_(deformation), weights_(weights) {
    matrices_.reserve(joints.size());
    for (const Affine& joint : joints) matrices_.push_back(pad(joint));
    out_.positions.resize(mesh.positions.size());
    out_.normals.resize(mesh.normals.size());
  }

  DeformedVertices run() {
    const std::size_t count = mesh_.positions.size(), blocks = (count + kBlock - 1) / kBlock;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks, kBlocksPerTask), [&](const auto& range) {
      Block positions, normals;
      for (std::size_t b = range.begin(); b < range.end(); ++b) {
        positions.begin = normals.begin = b * kBlock;
        positions.end = normals.end = std::min(count, (b + 1) * kBlock);
        morph(positions, mesh_.positions, &MorphTarget::positions);
        if (!mesh_.normals.empty()) morph(normals, mesh_.normals, &MorphTarget::normals);
        matrices_.empty() || deformation_.influences == 0 ? store(positions, normals)
                                                          : skin(positions, normals);
      }
    });
    return std::move(out_);
  }

 private:
  void morph(Block& block, const std::vector<Vec3f>& base, std::vector<Vec3f> MorphTarget::*member) const {
    block.load(base);
    const std::size_t count = std::min(weights_.size(), deformation_.morph_targets.size());
    for (std::size_t t = 0; t < count; ++t) {
      const MorphTarget& target = deformation_.morph_targets[t];
      block.add(weights_[t], target.*member, target.vertex_ids);
    }
  }

  void store(const Block& positions, const Block& normals) {
    static constexpr JointMatrix kIdentity{{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0}};
    for (std::size_t v = positions.begin; v < positions.end; ++v) {
      out_.positions[v] = Vec3f(positions.at(v));
      if (!out_.normals.empty()) out_.normals[v] = turn_normal(kIdentity, normals.at(v), mesh_.normals[v]);
    }
  }

  void skin(const Block& positions, const Block& normals) {
    for (std::size_t v = positions.begin; v < positions.end; ++v) {
      const JointMatrix m = blend(v);
      const Vec3d p = positions.at(v);
      double sums[4];
      for (int r = 0; r < 4; ++r)
        sums[r] = m.columns[r] * p.x + m.columns[4 + r] * p.y + m.columns[8 + r] * p.z + m.columns[12 + r];
      out_.positions[v] = Vec3f(Vec3d(sums[0], sums[1], sums[2]));
      if (!out_.normals.empty()) out_.normals[v] = turn_normal(m, normals.at(v), mesh_.normals[v]);
    }
  }

  /// The matrix of a vertex: its joints' by weight, over the sum of the weights.
  [[nodiscard]] JointMatrix blend(std::size_t vertex) const {
    const std::size_t influences = deformation_.influences;
    const float* weights = &deformation_.weights[influences * vertex];
    const std::uint16_t* joints = &deformation_.joints[influences * vertex];
    double sum = 0.0;
    for (std::size_t k = 0; k < influences; ++k) sum += double(weights[k]);
    if (!(sum > 0.0)) return matrices_[joints[0]];
    const double scale = 1.0 / sum;
    JointMatrix blended{};
    for (std::size_t k = 0; k < influences; ++k) {
      const double weight = double(weights[k]) * scale;
      if (weight == 0.0) continue;
      const JointMatrix& matrix = matrices_[joints[k]];
      for (int i = 0; i < 16; ++i) blended.columns[i] += weight * matrix.columns[i];
    }
    return blended;
  }

  const TriangleMesh& mesh_;
  const MeshDeformation& deformation_;
  std::span<const double> weights_;
  std::vector<JointMatrix> matrices_;
  DeformedVertices out_;
};

}  // namespace

DeformedVertices deform(const TriangleMesh& mesh, const MeshDeformation& deformation,
                        std::span<const double> weights, std::span<const Affine> joints) {
  return Deformer(mesh, deformation, weights, joints).run();
}

}  // namespace gridcast::mesh
