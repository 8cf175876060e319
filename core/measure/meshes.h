#pragma once
// The meshes of the benchmark, generated: the same seed and count give the same mesh on every machine.
// `count` is the number of triangles aimed at; what comes out is within a few percent of it.

#include <cstddef>
#include <cstdint>

#include "core/mesh/triangle_mesh.h"

namespace gridcast::measure {

/// A closed organic body with lobes, like the Stanford bunny. About 2 units across.
[[nodiscard]] mesh::TriangleMesh organic_mesh(std::size_t count, std::uint64_t seed);
/// A closed figure with fine detail and unevenly spaced vertices, like a cleaned laser scan.
[[nodiscard]] mesh::TriangleMesh scan_mesh(std::size_t count, std::uint64_t seed);
/// A square of fractal terrain, y up, 2 units a side.
[[nodiscard]] mesh::TriangleMesh terrain_mesh(std::size_t count, std::uint64_t seed);
/// A hall of pillars, straight and twisted, with diagonal rods under the ceiling: long thin triangles among
/// walls of large quads. 40 x 10 x 16 units.
[[nodiscard]] mesh::TriangleMesh hall_mesh(std::size_t count, std::uint64_t seed);
/// Small triangles of random place and direction in the unit cube.
[[nodiscard]] mesh::TriangleMesh soup_mesh(std::size_t count, std::uint64_t seed);
/// Curved ribbons on a ball: thin triangles.
[[nodiscard]] mesh::TriangleMesh hair_mesh(std::size_t count, std::uint64_t seed);
/// A tree of a forest: a trunk and a crown of leaves.
[[nodiscard]] mesh::TriangleMesh tree_mesh(std::size_t count, std::uint64_t seed);

// Worst cases.
/// Triangles as large as the scene, all through its middle: every box overlaps every other.
[[nodiscard]] mesh::TriangleMesh overlapping_mesh(std::size_t count, std::uint64_t seed);
/// A dense scan under one triangle that covers it all.
[[nodiscard]] mesh::TriangleMesh huge_triangle_mesh(std::size_t count, std::uint64_t seed);
/// A fan of needles around one vertex, slightly conical.
[[nodiscard]] mesh::TriangleMesh fan_mesh(std::size_t count, std::uint64_t seed);
/// Random small triangles in the plane y = 0: boxes without thickness.
[[nodiscard]] mesh::TriangleMesh flat_mesh(std::size_t count, std::uint64_t seed);
/// Needles half as long as the scene, in all directions: boxes overlap and hold next to nothing.
[[nodiscard]] mesh::TriangleMesh needles_mesh(std::size_t count, std::uint64_t seed);

}  // namespace gridcast::measure
