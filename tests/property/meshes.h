#pragma once
// The meshes that properties are checked on: made here, and every mesh file beside the repository.

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>
#include <vector>

#include "core/io/gltf.h"
#include "core/mesh/topology.h"
#include "tests/support/assets.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::property {

using blas::MeshCase;
using blas::StructureCase;
using mesh::TriangleMesh;
using test::Random;

/// GRIDCAST_RAYS if set, else `standard`: rays per mesh, structure and class of rays.
inline std::size_t ray_count(std::size_t standard) {
  const char* text = std::getenv("GRIDCAST_RAYS");
  return text != nullptr ? std::size_t(std::strtoull(text, nullptr, 0)) : standard;
}

/// The pad of every box is some 2^-17 of the largest coordinate. Where that is a good part of the mesh (a
/// small mesh with a large offset baked into its floats) nothing is culled and every ray costs the whole
/// mesh: still right, but a hundredth of the rays has to do.
inline std::size_t affordable(const TriangleMesh& mesh, std::size_t rays) {
  const Bounds3d bounds = to_double(mesh.bounds());
  const bool culls = bounds.magnitude() * 0x1p-17 + 0x1p-100 < max_abs(bounds.extent()) / 64.0;
  return culls ? rays : std::max<std::size_t>(20, rays / 100);
}

/// Every structure that has a tree; brute force is what they are compared with.
inline std::vector<StructureCase> tree_cases() {
  std::vector<StructureCase> trees;
  for (const StructureCase& structure : blas::structure_cases())
    if (structure.options.kind != blas::StructureKind::kAuto) trees.push_back(structure);
  return trees;
}

inline std::vector<MeshCase> generated_meshes() {
  std::vector<MeshCase> meshes = blas::mesh_cases();
  meshes.push_back({"box city", test::share(test::box_city(12, 3))});
  meshes.push_back({"fine jittered icosphere", test::share(test::jittered_icosphere(5, 21))});
  meshes.push_back({"fine torus", test::share(test::torus(300, 60))});
  return meshes;
}

/// All meshes of all files below `root`, by path.
inline std::vector<MeshCase> meshes_below(const std::filesystem::path& root) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(root))
    if (entry.path().extension() == ".glb") files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<MeshCase> meshes;
  for (const std::filesystem::path& file : files) {
    const Result<scene::SceneData> data = io::import_gltf_file(file);
    if (!data) {
      ADD_FAILURE() << file << ": " << data.error().message << " at " << data.error().where;
      continue;
    }
    for (const auto& mesh : data->meshes)
      if (mesh->triangle_count() != 0) meshes.push_back({file.stem().string(), mesh});
  }
  return meshes;
}

/// Closed and consistently wound, so that its winding number is an integer off the surface.
inline bool encloses_space(const TriangleMesh& mesh) {
  const mesh::TopologyReport report = mesh::analyse_topology(mesh);
  return report.closed && report.inconsistent_edges == 0;
}

}  // namespace gridcast::property
