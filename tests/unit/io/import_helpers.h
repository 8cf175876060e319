#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/io/gltf.h"

namespace gridcast::test {

/// Imports and expects success; an empty scene otherwise.
inline scene::SceneData import_ok(const std::vector<std::byte>& bytes, const io::GltfOptions& options = {}) {
  auto scene = io::import_gltf(bytes, options);
  if (scene) return std::move(scene).value();
  ADD_FAILURE() << "refused: " << scene.error().message << " at " << scene.error().where;
  return {};
}

/// Imports and expects a refusal.
inline Error import_error(const std::vector<std::byte>& bytes, const io::GltfOptions& options = {}) {
  const auto scene = io::import_gltf(bytes, options);
  if (!scene) return scene.error();
  ADD_FAILURE() << "was expected to be refused";
  return {};
}

/// Triangles of every instance together.
inline std::size_t world_triangles(const scene::SceneData& scene) {
  std::size_t sum = 0;
  for (const auto& instance : scene.instances) sum += scene.meshes[instance.mesh_id]->triangle_count();
  return sum;
}

inline std::size_t stored_triangles(const scene::SceneData& scene) {
  std::size_t sum = 0;
  for (const auto& mesh : scene.meshes) sum += mesh->triangle_count();
  return sum;
}

}  // namespace gridcast::test
