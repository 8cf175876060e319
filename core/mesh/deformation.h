#pragma once
// What of a mesh is needed to deform it: morph targets, then the joints that its vertices follow.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/error.h"
#include "core/math/vec.h"

namespace gridcast::mesh {

/// Displacements of one morph target: one for each vertex, or, with `vertex_ids`, one for each of those
/// alone.
struct MorphTarget {
  std::vector<Vec3f> positions;           ///< empty = none
  std::vector<Vec3f> normals;             ///< empty = none
  std::vector<std::uint32_t> vertex_ids;  ///< ascending; empty = all vertices in order
};

/// Without targets and influences the mesh is static.
struct MeshDeformation {
  std::vector<MorphTarget> morph_targets;
  std::vector<float> default_weights;  ///< one per target; missing ones are 0
  std::uint32_t influences = 0;        ///< joints per vertex: 0, 4 or 8
  std::vector<std::uint16_t> joints;   ///< [vertices, influences], indices into a skin's joints
  std::vector<float> weights;          ///< [vertices, influences]
  [[nodiscard]] bool empty() const { return morph_targets.empty() && influences == 0; }
  [[nodiscard]] std::size_t memory_bytes() const;
};

/// Sizes that fit a mesh of `vertex_count` vertices, finite numbers, ids in range and ascending. The error
/// names the first offending array (`/morph_targets/2/positions`).
[[nodiscard]] Status validate(const MeshDeformation& deformation, std::size_t vertex_count);

/// Keeps only the vertices that move, when they are so few that this takes less memory.
void make_sparse(MorphTarget& target);

/// The largest joint that a vertex names; kInvalidId when none does.
[[nodiscard]] std::uint32_t largest_joint(const MeshDeformation& deformation);

}  // namespace gridcast::mesh
