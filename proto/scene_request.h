#pragma once
// Bodies that create scenes and add, move and patch instances.
//
// A transform is world_from_object as nested ROWS: 3x4 [[r00,r01,r02,tx],[r10,r11,r12,ty],[r20,r21,r22,tz]],
// or 4x4 with the last row [0,0,0,1]; so numpy's matrix.tolist() is right. (glTF's flat arrays are
// column-major; they are not taken here.)

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/math/affine.h"
#include "core/math/instance_mask.h"
#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/query.h"

namespace gridcast::proto {

/// A scene's name is its id and part of its path: letters, digits, '_', '.' and '-', not "." or "..".
inline constexpr std::size_t kMaxSceneNameBytes = 64;
[[nodiscard]] bool is_scene_name(std::string_view name);

/// POST /v1/scenes?name=&structure=&quality=&scene= beside any body.
struct SceneQuery {
  std::string name;                         ///< empty: the server makes one
  std::string structure = "auto";           ///< one of kStructureNames
  std::string quality = "default";          ///< one of kBuildQualityNames
  std::optional<std::uint32_t> gltf_scene;  ///< which scene of the document; none = its default
};
[[nodiscard]] Parsed<SceneQuery> parse_scene_query(const QueryParameters& query, const Limits& limits);

/// GET .../structure?steps=&deadline_ms=
struct StructureQuery {
  std::size_t steps = 0;              ///< of how many rays to count the steps, in each tree
  std::optional<double> deadline_ms;  ///< for counting them
};
inline constexpr std::size_t kMaxCountedRays = 4096;
[[nodiscard]] Parsed<StructureQuery> parse_structure_query(const QueryParameters& query,
                                                           const Limits& limits);

/// POST /v1/scenes with JSON {"name": "..."}: an empty scene.
struct EmptySceneRequest {
  std::string name;
};
[[nodiscard]] Parsed<EmptySceneRequest> parse_empty_scene(std::string_view body, const Limits& limits);

/// POST .../instances: {"mesh_id": 3, "transform": [[...]]?, "name": "..."?, "mask": 0 to 255?}; default
/// transform identity, default mask 255.
struct AddInstanceRequest {
  std::uint32_t mesh_id = kInvalidId;
  Affine world_from_object;
  std::string name;
  InstanceMask mask = kFullMask;
};
[[nodiscard]] Parsed<AddInstanceRequest> parse_add_instance(std::string_view body, const Limits& limits);

/// PATCH .../instances/{i}: {"transform": [[...]]?, "mask": 0 to 255?, "name": "..."?}, at least one of them;
/// the rest stays.
struct ChangeInstanceRequest {
  std::optional<Affine> world_from_object;
  std::optional<InstanceMask> mask;
  std::optional<std::string> name;
};
[[nodiscard]] Parsed<ChangeInstanceRequest> parse_change_instance(std::string_view body,
                                                                  const Limits& limits);

/// POST .../scenes/{s}:fork?name=: the name of the copy; empty: the server makes one.
[[nodiscard]] Parsed<std::string> parse_fork_query(const QueryParameters& query);

/// PATCH .../instances: JSON {"moves": [{"instance_id": 3, "transform": [[...]]?, "mask"?, "name"?}, ...]}
/// with the members of a change, or binary (application/vnd.gridcast.instances; dtype=float64|float32;
/// default float64), little-endian: uint32 [K] instance ids, then [K, 3, 4] matrices, each three rows of
/// [linear | translation]. Each instance once, all in one version. Pointers of problems, those of core too,
/// are
/// `/moves/INDEX`.
struct InstanceMove {
  std::uint32_t instance_id = kInvalidId;
  Affine world_from_object;
};
struct InstanceChange {
  std::uint32_t instance_id = kInvalidId;
  ChangeInstanceRequest change;
};
/// One of the two is empty.
struct InstancePatch {
  std::vector<InstanceMove> moves;      ///< where each has a transform and nothing else, the fast way
  std::vector<InstanceChange> changes;  ///< where one has something else
  [[nodiscard]] std::size_t size() const { return moves.size() + changes.size(); }
};
[[nodiscard]] Parsed<InstancePatch> parse_move_instances(std::string_view content_type, std::string_view body,
                                                         const Limits& limits);

}  // namespace gridcast::proto
