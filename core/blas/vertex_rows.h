#pragma once
// Vertices by whole registers, as builders and refits read them: a row is x, y, z of one, a column one
// coordinate of four.

#include <cstring>
#include <vector>

#include "core/blas/float4.h"
#include "core/blas/triangle_block.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::blas {

struct Columns {
  Float4 x, y, z;
};

/// Four rows of x, y, z and anything as columns.
inline Columns transposed(Float4 a, Float4 b, Float4 c, Float4 d) {
  const Float4 low_ab = __builtin_shufflevector(a, b, 0, 4, 1, 5);
  const Float4 low_cd = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Float4 high_ab = __builtin_shufflevector(a, b, 2, 6, 3, 7);
  const Float4 high_cd = __builtin_shufflevector(c, d, 2, 6, 3, 7);
  return {__builtin_shufflevector(low_ab, low_cd, 0, 1, 4, 5),
          __builtin_shufflevector(low_ab, low_cd, 2, 3, 6, 7),
          __builtin_shufflevector(high_ab, high_cd, 0, 1, 4, 5)};
}

/// The vertices of a mesh as rows; the fourth lane is whatever follows in memory. Not for a mesh without any.
class VertexRows {
 public:
  explicit VertexRows(const mesh::TriangleMesh& mesh)
      : first_(mesh.positions.data()), last_(mesh.positions.size() - 1) {}

  [[nodiscard]] Float4 operator()(std::uint32_t vertex) const {
    const Vec3f* const p = first_ + vertex;
    if (vertex == last_) [[unlikely]]  // nothing follows
      return Float4{p->x, p->y, p->z, 0.F};
    Float4 row;
    std::memcpy(&row, &p->x, sizeof row);
    return row;
  }

 private:
  const Vec3f* first_;
  std::size_t last_;
};

/// -0 turned into +0: minimum and maximum of the two would depend on their order.
inline Box4 without_negative_zero(const Box4& box) {
  return {box.lower + broadcast(0.F), box.upper + broadcast(0.F)};
}

/// Fills in the corners of the triangles that the block names, as load_corners() does, and returns the box
/// around them, in which a zero has any sign.
inline Box4 load_rows(const VertexRows& vertices, const mesh::Triangle* triangles, TriangleBlock& block) {
  Float4 rows[3][4];
  Box4 box;
  for (std::size_t lane = 0; lane < 4; ++lane) {
    const mesh::Triangle& triangle = triangles[block.ids[lane]];
    for (std::size_t corner = 0; corner < 3; ++corner) {
      rows[corner][lane] = vertices(triangle[corner]);
      box.extend(rows[corner][lane]);
    }
  }
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const Columns columns = transposed(rows[corner][0], rows[corner][1], rows[corner][2], rows[corner][3]);
    std::memcpy(block.corners[corner], &columns, sizeof columns);
  }
  return box;
}

}  // namespace gridcast::blas
