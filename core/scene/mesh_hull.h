#pragma once

#include <array>
#include <cstddef>

#include "core/math/bounds.h"
#include "core/math/vec.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::scene {

/// How far a mesh reaches along 26 directions, those from the centre of a cube to its faces, edges and
/// corners: enough for a world box of a turned instance that is nearly as tight as one from all vertices, at
/// the price of a few multiplications. (A box from the eight corners of the object box has up to three times
/// the surface for a round mesh, so that many more rays look at the instance in vain.) "Efficient Collision
/// Detection Using Bounding Volume Hierarchies of k-DOPs", J. T. Klosowski, 1998, has the directions.
class MeshHull {
 public:
  MeshHull() = default;
  /// `bounds` is mesh.bounds(). Linear in the number of positions, parallel.
  MeshHull(const mesh::TriangleMesh& mesh, const Bounds3f& bounds);

  [[nodiscard]] bool empty() const { return magnitude_ < 0.F; }
  /// Largest absolute coordinate of a vertex.
  [[nodiscard]] float magnitude() const { return magnitude_; }

  /// At least n . p for every vertex p, within the rounding of doubles (5 times 2^-53 |n|_1 magnitude()).
  ///
  /// n = (a - b) e + (b - c) (e + f) + c (e + f + g) where a >= b >= c are its components without their signs
  /// and e, f, g the signed axes in that order: a sum of three of the 26 directions with factors >= 0, and
  /// the reach along a sum is at most the sum of the reaches.
  [[nodiscard]] double reach(const Vec3d& n) const;

 private:
  /// Direction (x, y, z), each -1, 0 or 1, is number x + 3 y + 9 z; 0 is unused.
  static constexpr int kLargestNumber = 13;
  [[nodiscard]] const float& at(int number) const { return reach_[std::size_t(number) + kLargestNumber]; }
  [[nodiscard]] float& at(int number) { return reach_[std::size_t(number) + kLargestNumber]; }

  std::array<float, 2 * kLargestNumber + 1> reach_{};
  float magnitude_ = -1.F;
};

}  // namespace gridcast::scene
