#pragma once
// Meshes for tests, all made here.

#include <cstdint>
#include <memory>

#include "core/mesh/triangle_mesh.h"

namespace gridcast::test {

using mesh::TriangleMesh;

TriangleMesh single_triangle();                                ///< (0,0,0) (1,0,0) (0,1,0)
TriangleMesh box(const Vec3f& lower, const Vec3f& upper);      ///< closed, 12 triangles, outward
TriangleMesh icosphere(int subdivisions, float radius = 1.F);  ///< closed, 20 * 4^n triangles
TriangleMesh jittered_icosphere(int subdivisions, std::uint64_t seed,
                                float radius = 1.F);                                ///< closed, uneven
TriangleMesh torus(int around, int across, float major = 1.F, float minor = 0.3F);  ///< closed
TriangleMesh needle_fan(int triangles);               ///< closed double cone, one vertex of that valence
TriangleMesh quad_grid(int cells, float size = 1.F);  ///< flat, z = 0, 2 * cells^2 triangles
TriangleMesh soup(int triangles, std::uint64_t seed,
                  float edge = 0.1F);                                   ///< random, unconnected, in [-1, 1]^3
TriangleMesh slivers(int triangles, std::uint64_t seed, float aspect);  ///< long thin random triangles
TriangleMesh translated(TriangleMesh mesh, const Vec3f& offset);        ///< offset baked into the floats

/// blocks^2 boxes with shared planes: every wall lies in planes of others.
TriangleMesh box_city(int blocks, std::uint64_t seed);
/// Closed: the faces between about half of n^3 unit cells, chosen at random, and the rest. Edges and vertices
/// are shared by up to 8 and 24 triangles.
TriangleMesh voxel_boundary(int n, std::uint64_t seed);

/// `copies` of the same mesh in one: exact ties everywhere.
TriangleMesh repeated(const TriangleMesh& mesh, int copies);

inline std::shared_ptr<const TriangleMesh> share(TriangleMesh mesh) {
  return std::make_shared<const TriangleMesh>(std::move(mesh));
}

}  // namespace gridcast::test
