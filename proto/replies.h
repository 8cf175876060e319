#pragma once
// Small replies: plain structs that the server fills, to JSON text.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/math/affine.h"
#include "core/math/bounds.h"
#include "core/math/instance_mask.h"
#include "proto/limits.h"

namespace gridcast::proto {

/// GET /v1.
struct ServiceInfo {
  std::string version;          ///< of the program
  std::string instruction_set;  ///< in use: avx512, avx2, sse4 ... (core/math/instruction_set.h)
  std::size_t threads = 0;
  Limits limits;
};

/// POST and GET of a scene. Empty bounds are null on the wire.
struct SceneInfo {
  std::string id;
  std::string name;
  std::uint64_t version = 1;
  std::string structure;  ///< asked for at creation: one of kStructureNames
  std::string quality;    ///< asked for at creation: one of kBuildQualityNames
  std::size_t mesh_count = 0;
  std::size_t instance_count = 0;
  std::uint64_t world_triangle_count = 0;   ///< triangles times instances
  std::uint64_t stored_triangle_count = 0;  ///< triangles of the meshes
  std::size_t material_count = 0;
  std::size_t camera_count = 0;
  std::size_t light_count = 0;
  Bounds3d bounds;
  std::size_t memory_bytes = 0;
  double import_ms = 0.0;  ///< reading the file
  double build_ms = 0.0;   ///< building the structures
  std::vector<std::string> warnings;
  struct Animation {
    std::string name;
    double duration_s = 0.0;
  };
  struct Skin {
    std::string name;
    std::vector<std::uint32_t> joint_ids;  ///< node ids
  };
  /// What poses may name, by index; absent in the list of scenes.
  struct Rig {
    std::vector<Animation> animations;
    std::vector<Skin> skins;
  };
  std::optional<Rig> rig;
  /// Versions that can be asked for, none missing between them, and since which the log tells all; of a
  /// server's scene.
  struct Kept {
    std::uint64_t oldest = 0;
    std::uint64_t newest = 0;
    std::uint64_t log_since = 0;
  };
  std::optional<Kept> kept;
};

/// A bottom-level structure, in GET structure and in a mesh.
struct MeshStructureInfo {
  std::uint32_t mesh_id = 0;
  std::string kind;            ///< brute_force, bvh, wide_bvh, compact_bvh, kd_tree, embree
  std::string reason;          ///< why this kind, as a sentence
  std::string quality_asked;   ///< of the scene: one of kBuildQualityNames
  std::string quality;         ///< that the tree was built with
  std::string quality_reason;  ///< why this one, as a sentence
  std::size_t triangle_count = 0;
  std::size_t node_count = 0;
  std::size_t leaf_count = 0;
  std::size_t reference_count = 0;
  std::size_t max_depth = 0;
  std::size_t memory_bytes = 0;
  double cost = 0.0;
  double cost_at_build = 0.0;
  std::optional<double> looseness;  ///< none where it is not known
  std::optional<double> looseness_at_build;
  std::optional<double> steps_per_ray;  ///< none where they were not counted
  double build_ms = 0.0;
  std::uint32_t refits_since_build = 0;
};

struct MeshInfo {
  std::uint32_t mesh_id = 0;
  std::string name;
  std::size_t vertex_count = 0;
  std::size_t triangle_count = 0;
  std::size_t instance_count = 0;
  Bounds3d bounds;  ///< object space
  std::uint32_t topology_version = 0;
  std::uint32_t vertex_version = 0;
  std::size_t morph_target_count = 0;
  std::optional<std::uint32_t> skin_id;  ///< that the vertices follow
  /// Of GET meshes/{m} alone: absent in the list.
  struct Topology {
    bool closed = false;
    std::size_t edge_count = 0;
    std::size_t boundary_edges = 0;
    std::size_t non_manifold_edges = 0;
    std::size_t inconsistent_edges = 0;
    std::size_t degenerate_faces = 0;
    std::size_t components = 0;
  };
  std::optional<Topology> topology;
  MeshStructureInfo structure;
};

struct InstanceInfo {
  std::uint32_t instance_id = 0;
  std::uint32_t mesh_id = 0;
  std::string name;
  Affine world_from_object;
  Bounds3d bounds;     ///< world space
  bool active = true;  ///< false: the transform is singular, nothing of it is ever hit
  InstanceMask mask = kFullMask;
};

struct InstanceList {
  std::uint64_t scene_version = 0;
  std::size_t total = 0;  ///< live instances of the scene
  std::vector<InstanceInfo> instances;
  std::optional<std::size_t> next_offset;  ///< of the next page, in instance slots; none at the end
};

/// GET structure.
struct StructureInfo {
  std::uint64_t scene_version = 0;
  struct TopLevel {
    std::string kind;  ///< none, one_level, uniform_grid, nested_grid
    std::string reason;
    std::uint32_t cells[3] = {0, 0, 0};
    Bounds3d bounds;
    std::size_t instance_count = 0;
    std::size_t cell_count = 0;
    std::size_t occupied_cells = 0;
    std::size_t reference_count = 0;
    std::size_t max_references_in_cell = 0;
    std::size_t memory_bytes = 0;
    double build_ms = 0.0;
  };
  TopLevel top_level;
  std::vector<MeshStructureInfo> meshes;
};

/// PATCH vertices.
struct VertexReply {
  std::uint64_t scene_version = 0;
  std::string action;  ///< refit, rebuild
  std::string reason;
  double cost_before = 0.0;
  double cost_after = 0.0;
  double ms = 0.0;
};

/// PATCH of the instances collection.
struct MovesReply {
  std::uint64_t scene_version = 0;
  std::size_t moved = 0;
  double ms = 0.0;
};

[[nodiscard]] std::string to_json(const ServiceInfo& info);
[[nodiscard]] std::string to_json(const SceneInfo& info);
[[nodiscard]] std::string to_json(const std::vector<SceneInfo>& scenes,
                                  const std::vector<std::string>& damaged = {});  ///< {"scenes": [...]}
[[nodiscard]] std::string to_json(const MeshInfo& info, std::uint64_t scene_version);
/// {"scene_version", "meshes": [...]}
[[nodiscard]] std::string to_json(const std::vector<MeshInfo>& meshes, std::uint64_t scene_version);
[[nodiscard]] std::string to_json(const InstanceInfo& info, std::uint64_t scene_version);
[[nodiscard]] std::string to_json(const InstanceList& list);
[[nodiscard]] std::string to_json(const StructureInfo& info);
[[nodiscard]] std::string to_json(const VertexReply& reply);
[[nodiscard]] std::string to_json(const MovesReply& reply);
/// {"status": "live"} and the like, for the probes.
[[nodiscard]] std::string health_json(std::string_view status);

}  // namespace gridcast::proto
