#include "core/measure/figure.h"

#include <algorithm>
#include <cmath>

#include "core/mesh/topology.h"

namespace gridcast::measure {
namespace {

constexpr double kTwoPi = 6.28318530717958647692;
constexpr std::uint32_t kInfluences = 4;
/// Over this part of a bone its parent's share falls from a half to nothing.
constexpr double kSoftPart = 0.3;

class FigureMaker {
 public:
  FigureMaker(std::size_t triangles, double girth)
      : girth_(girth), sides_(std::uint32_t(std::max(3.0, std::sqrt(double(triangles) / 22.0)))) {
    // A bone of R rings of S vertices between two poles has 2 S R triangles.
    const double per_bone = double(triangles) / double(kFigureJoints.size());
    rings_ = std::uint32_t(std::max(2.0, std::round(per_bone / (2.0 * double(sides_)))));
    figure_.deformation.influences = kInfluences;
  }

  Figure run() {
    for (std::size_t j = 0; j < kFigureJoints.size(); ++j) add_bone(std::uint16_t(j));
    figure_.mesh.name = "figure";
    figure_.mesh.normals = mesh::smooth_normals(figure_.mesh);
    return std::move(figure_);
  }

 private:
  void add_vertex(const Vec3d& p, std::uint16_t joint, double part) {
    figure_.mesh.positions.emplace_back(p);
    const std::uint32_t parent = kFigureJoints[joint].parent;
    const double of_parent = parent == kInvalidId ? 0.0 : 0.5 * std::max(0.0, 1.0 - part / kSoftPart);
    mesh::MeshDeformation& bent = figure_.deformation;
    const std::uint16_t other = parent == kInvalidId ? joint : std::uint16_t(parent);
    bent.joints.insert(bent.joints.end(), {joint, other, 0, 0});
    bent.weights.insert(bent.weights.end(), {float(1.0 - of_parent), float(of_parent), 0.F, 0.F});
  }

  void add_bone(std::uint16_t j) {
    const FigureJoint& bone = kFigureJoints[j];
    const Vec3d along = bone.end - bone.place, axis = glm::normalize(along);
    const Vec3d a = glm::cross(axis, Vec3d(0.0, 0.0, 1.0)), b = glm::cross(axis, a);
    const auto first = std::uint32_t(figure_.mesh.positions.size());
    add_vertex(bone.place, j, 0.0);
    for (std::uint32_t r = 0; r < rings_; ++r) {
      const double part = (double(r) + 0.5) / double(rings_);
      const double radius = girth_ * bone.radius * std::sqrt(1.0 - std::pow(2.0 * part - 1.0, 4.0));
      for (std::uint32_t s = 0; s < sides_; ++s) {
        const double angle = kTwoPi * double(s) / double(sides_);
        add_vertex(bone.place + part * along + radius * (std::cos(angle) * a + std::sin(angle) * b), j, part);
      }
    }
    add_vertex(bone.end, j, 1.0);
    close(first);
  }

  /// The triangles between the poles and rings that start at vertex `first`, outside out.
  void close(std::uint32_t first) {
    const auto at = [&](std::uint32_t ring, std::uint32_t side) {
      return first + 1 + ring * sides_ + side % sides_;
    };
    const std::uint32_t last = first + 1 + rings_ * sides_;
    auto& triangles = figure_.mesh.triangles;
    for (std::uint32_t s = 0; s < sides_; ++s) {
      triangles.push_back({first, at(0, s + 1), at(0, s)});
      for (std::uint32_t r = 0; r + 1 < rings_; ++r) {
        triangles.push_back({at(r, s), at(r, s + 1), at(r + 1, s)});
        triangles.push_back({at(r + 1, s), at(r, s + 1), at(r + 1, s + 1)});
      }
      triangles.push_back({last, at(rings_ - 1, s), at(rings_ - 1, s + 1)});
    }
  }

  double girth_;
  std::uint32_t sides_, rings_ = 2;
  Figure figure_;
};

}  // namespace

Figure make_figure(std::size_t triangles, double girth) {
  return FigureMaker(triangles, girth).run();
}

}  // namespace gridcast::measure
