#pragma once
// Scenes as bytes. What is written is what the engine computes from, not the uploaded file: an importer that
// gets better does not change the answers of a scene that is there.

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/scene/scene_state.h"
#include "server/store/sha256.h"

namespace gridcast::server::store {

/// What meshes and what a file held are written in.
inline constexpr std::uint32_t kContentFormat = 1;
/// What snapshots and updates are written in. 1 had neither masks nor new names of instances.
inline constexpr std::uint32_t kVersionFormat = 2;
// Each changes with every change of what is written below. Older ones are read, newer ones refused.

[[nodiscard]] std::string encode(const mesh::TriangleMesh& mesh);
[[nodiscard]] Result<mesh::TriangleMesh> decode_mesh(std::string_view bytes);

/// Without its meshes.
[[nodiscard]] std::string encode(const scene::SceneData& data);
[[nodiscard]] Result<scene::SceneData> decode_data(std::string_view bytes);

struct StoredMesh {
  Digest file{};
  blas::BuildOptions build;
};
/// One version, its bulk in files of their own.
struct Snapshot {
  std::uint64_t version = 1;
  blas::BuildOptions build;
  Digest data{};
  std::shared_ptr<const scene::Pose> pose;
  std::vector<Digest> source_meshes;  ///< SceneData::meshes
  std::vector<StoredMesh> meshes;
  std::vector<scene::InstanceState> instances;
  std::vector<scene::InstanceName> added_names;
  std::map<std::uint32_t, std::string> new_names;
};
[[nodiscard]] std::string encode(const Snapshot& snapshot);
[[nodiscard]] Result<Snapshot> decode_snapshot(std::string_view bytes);

/// Vertices that moved are written alone where that is shorter.
[[nodiscard]] std::string encode(const scene::SceneDelta& delta);
/// Brings the states of versions up to date, one encoded delta after the other.
class DeltaReplay {
 public:
  explicit DeltaReplay(scene::SceneState& state) : state_(state) {}
  /// kInvalidFile when the bytes are no delta of this state; it is not to be used then.
  [[nodiscard]] Status apply(std::string_view bytes);

 private:
  scene::SceneState& state_;
  std::vector<std::shared_ptr<mesh::TriangleMesh>> own_;  ///< meshes of the state that nobody else holds
};

}  // namespace gridcast::server::store
