#pragma once
// Deformation again, from the text of glTF 2.0, in long double: one vertex at a time, one joint at a time,
// points moved by each joint and then averaged. Shares nothing with core/mesh/deform.cpp but its input.

#include <array>
#include <span>

#include "core/math/affine.h"
#include "core/mesh/deformation.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::test {

struct ReferencePoint {
  std::array<long double, 3> position;
  std::array<long double, 3> magnitude;  ///< sum of the magnitudes of the terms, per axis the same
};

/// Where a vertex goes. A vertex whose weights have no positive sum follows its first joint.
ReferencePoint reference_position(const mesh::TriangleMesh& mesh, const mesh::MeshDeformation& deformation,
                                  std::span<const double> weights, std::span<const Affine> joints,
                                  std::size_t vertex);

}  // namespace gridcast::test
