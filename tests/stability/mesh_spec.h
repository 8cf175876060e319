#pragma once
// Meshes by a line of text, so that a saved case says in a few words what it was cast at.

#include <string>

#include "core/mesh/triangle_mesh.h"

namespace gridcast::stability {

/// Makes the mesh that `spec` names: a generator with its numbers, then changes, parted by " | ":
///
///     jittered_icosphere 3 5 | scale 1 1e-4 1 | translate 1e6 0 0
///
/// Generators: triangle; box x0 y0 z0 x1 y1 z1; icosphere LEVEL; jittered_icosphere LEVEL SEED;
/// torus AROUND ACROSS; needle_fan TRIANGLES; quad_grid CELLS SIZE; soup TRIANGLES SEED EDGE;
/// slivers TRIANGLES SEED ASPECT; voxels N SEED; organic TRIANGLES SEED; flat TRIANGLES SEED;
/// box_city BLOCKS SEED; concentric TRIANGLES; geometric TRIANGLES; coplanar_stack LAYERS CELLS.
/// Changes: scale x y z; translate x y z (both in float); swap (x, y, z become y, z, x); repeat COPIES;
/// shuffle SEED (the order of the triangles); shrink SEED (every triangle gets a size of its own, 1 to
/// 2^-40).
///
/// Throws std::invalid_argument for anything else: a spec is written by us.
[[nodiscard]] mesh::TriangleMesh make_mesh(const std::string& spec);

}  // namespace gridcast::stability
