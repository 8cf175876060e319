#pragma once
// A better tree of a mesh, built while the present one serves, and put into a scene when it is ready. No
// answer changes by it, so the version stays the same.

#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "core/scene/update.h"

namespace gridcast::scene {

/// What has to be built: blas::Blas::build(mesh, options, stop). It holds the mesh alone, so that the version
/// of the scene that it was taken from can go.
struct TreeOrder {
  std::shared_ptr<const mesh::TriangleMesh> mesh;
  blas::BuildOptions options;
};

/// None for a mesh whose tree is good enough (wants_better_tree), or that is not there.
[[nodiscard]] std::optional<TreeOrder> better_tree(const Scene& scene, std::uint32_t mesh_id);

/// The meshes that an update leaves with a tree that a better one should follow, each once.
[[nodiscard]] std::vector<std::uint32_t> wanted_trees(const UpdateReport& report);

/// Why a tree is of no use to a scene any more.
enum class TreeRefusal : std::uint8_t {
  kMeshChanged,  ///< the mesh is not there, has other triangles, or another kind of structure by now
  kNotBetter     ///< over the present vertices it costs no less than the tree that is there
};

/// `tree`, refitted to the vertices that the mesh has in `scene` where they moved since it was built. Errors
/// are those of a refit.
[[nodiscard]] Result<blas::Blas> caught_up(const blas::Blas& tree, const Scene& scene, std::uint32_t mesh_id);

/// The same version of the scene with `tree`, caught up, in place of the mesh's present one. The error is
/// that of a refit.
[[nodiscard]] Result<std::variant<std::shared_ptr<const Scene>, TreeRefusal>> replace_tree(
    const Scene& scene, std::uint32_t mesh_id, const blas::Blas& tree);

}  // namespace gridcast::scene
