#pragma once

#include <span>
#include <vector>

#include "core/math/affine.h"
#include "core/mesh/deformation.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::mesh {

struct DeformedVertices {
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;  ///< unit; empty when the mesh has none
};

/// Morphs, then skins, as glTF 2.0 has it (sections 3.7.2.2 and 3.7.3.3): each vertex is
/// p = position + sum of weights[t] * displacement[t], then sum of w[k] * joints[joint[k]] p / sum of w[k].
/// Weights of joints whose sum is not positive make the vertex follow its first joint alone.
///
/// `mesh` is at rest and `deformation` valid for it; `weights` has one entry per morph target (missing ones
/// are 0); `joints` holds object_from_mesh of every joint and is empty for a mesh that follows none.
///
/// All arithmetic is double and rounded to float once: each coordinate is within 2^-24 |p| + (32 + number of
/// targets) 2^-53 m of the real-number result, m the sum of the magnitudes of the terms. Finite input may
/// still give infinity or NaN, for validate_positions to find. Normals follow the cofactors of the blended
/// matrix, which keeps them on the side that the winding says; one that vanishes stays as it was.
/// Parallel over vertices: the result does not depend on the number of threads.
[[nodiscard]] DeformedVertices deform(const TriangleMesh& mesh, const MeshDeformation& deformation,
                                      std::span<const double> weights, std::span<const Affine> joints);

}  // namespace gridcast::mesh
