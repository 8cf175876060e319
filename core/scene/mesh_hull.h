#pragma once

#include <array>
#include <cmath>
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

  struct Reach {
    double backward, forward;
  };
  /// `forward` is at least n . p and `backward` at least -n . p for every vertex p, within the rounding of
  /// doubles (5 times 2^-53 |n|_1 magnitude()).
  ///
  /// n = (a - b) e + (b - c) (e + f) + c (e + f + g) where a >= b >= c are its components without their signs
  /// and e, f, g the signed axes in that order: a sum of three of the 26 directions with factors >= 0, and
  /// the reach along a sum is at most the sum of the reaches.
  [[nodiscard]] Reach reach(const Vec3d& n) const {
    int step[3] = {n.x < 0.0 ? -1 : 1, n.y < 0.0 ? -3 : 3, n.z < 0.0 ? -9 : 9};
    double size[3] = {std::abs(n.x), std::abs(n.y), std::abs(n.z)};
    const auto order = [&](int a, int b) {
      const bool swap = size[a] < size[b];
      const double larger = swap ? size[b] : size[a], smaller = swap ? size[a] : size[b];
      const int first = swap ? step[b] : step[a], second = swap ? step[a] : step[b];
      size[a] = larger;
      size[b] = smaller;
      step[a] = first;
      step[b] = second;
    };
    order(0, 1);
    order(1, 2);
    order(0, 1);
    const int face = step[0], edge = face + step[1], corner = edge + step[2];
    const double f = size[0] - size[1], e = size[1] - size[2], c = size[2];
    return {f * double(along(-face)) + e * double(along(-edge)) + c * double(along(-corner)),
            f * double(along(face)) + e * double(along(edge)) + c * double(along(corner))};
  }
  /// The reach along one of the 26: direction (x, y, z), each -1, 0 or 1, is number x + 3 y + 9 z.
  [[nodiscard]] float along(int number) const { return numbered()[number]; }
  /// All of them, to be indexed by the number, from -13 to 13.
  [[nodiscard]] const float* numbered() const { return reach_.data() + kLargestNumber; }
  static constexpr int kLargestNumber = 13;  ///< 0 is unused
  static constexpr int kNumbers = 2 * kLargestNumber + 1;

  /// The same once more, to be looked up by the signs of x, y and z: bits 0, 1 and 2 of an index are set
  /// where they are negative, and that of an axis that does not count may be either.
  struct BySigns {
    std::array<float, 8> faces[3];  ///< by the axis along which
    std::array<float, 8> edges[3];  ///< by the axis that does not count
    std::array<float, 8> corners;
  };
  [[nodiscard]] const BySigns& by_signs() const { return by_signs_; }

 private:
  [[nodiscard]] float& at(int number) { return reach_[std::size_t(number) + kLargestNumber]; }

  void sort_by_signs();

  std::array<float, kNumbers> reach_{};
  BySigns by_signs_{};
  float magnitude_ = -1.F;
};

}  // namespace gridcast::scene
