#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/scene/scene.h"
#include "core/scene/update.h"
#include "proto/error_table.h"
#include "server/work_gate.h"

namespace gridcast::server {

/// What stays the same over a scene's life.
struct SceneOrigin {
  std::string structure = "auto";  ///< asked for at creation
  double import_ms = 0.0;
  double build_ms = 0.0;
};

/// A named scene: a pointer to its newest snapshot, and one writer at a time, in the order of arrival.
/// Readers never wait for a writer's work nor a writer for readers: the pointer alone is guarded. An old
/// version is freed when its last reader lets go of it.
class NamedScene {
 public:
  NamedScene(std::string id, std::shared_ptr<const scene::Scene> first, SceneOrigin origin)
      : id_(std::move(id)), origin_(std::move(origin)), current_(std::move(first)), versions_{current_} {}

  [[nodiscard]] const std::string& id() const { return id_; }
  [[nodiscard]] const SceneOrigin& origin() const { return origin_; }
  [[nodiscard]] std::shared_ptr<const scene::Scene> snapshot() const;

  /// Applies `edits` and publishes the new version, when `if_match` (an If-Match header, empty = none) names
  /// the current one. On any problem nothing changed. kCancelled when `stop` comes before this writer's turn.
  [[nodiscard]] std::variant<scene::UpdateResult, proto::Problem, Error> update(
      std::string_view if_match, const std::vector<scene::SceneEdit>& edits,
      const std::stop_token& stop = {});

  /// Versions in memory: the newest and those that queries still read.
  [[nodiscard]] std::size_t live_versions() const;

 private:
  friend class SceneStore;
  std::string id_;
  SceneOrigin origin_;
  WorkGate writing_{1};
  mutable std::mutex pointer_;  ///< guards what follows
  std::shared_ptr<const scene::Scene> current_;
  std::vector<std::weak_ptr<const scene::Scene>>
      versions_;  ///< the newest, and older ones not known to be gone
};

/// Nothing when If-Match allows a write to `version`.
[[nodiscard]] std::optional<proto::Problem> check_if_match(std::string_view if_match, std::uint64_t version);

/// All scenes of a server, by id.
class SceneStore {
 public:
  explicit SceneStore(std::size_t max_scenes) : max_scenes_(max_scenes) {}

  /// Letters, digits, '_', '.' and '-', 1 to 64 of them, not "." or "..".
  [[nodiscard]] static bool is_valid_id(std::string_view id);

  /// Nothing when a scene could be created under `id` now: for refusing before the work is done.
  [[nodiscard]] std::optional<proto::Problem> check_new(std::string_view id) const;
  /// An empty id gets the next free of s1, s2, ...
  [[nodiscard]] std::variant<std::shared_ptr<NamedScene>, proto::Problem> create(
      std::string id, std::shared_ptr<const scene::Scene> first, SceneOrigin origin);
  [[nodiscard]] std::shared_ptr<NamedScene> find(std::string_view id) const;
  /// In the order of their ids.
  [[nodiscard]] std::vector<std::shared_ptr<NamedScene>> list() const;
  /// Requests at work on the scene finish on it.
  [[nodiscard]] std::optional<proto::Problem> erase(std::string_view id, std::string_view if_match);

 private:
  std::size_t max_scenes_;
  mutable std::mutex mutex_;
  std::map<std::string, std::shared_ptr<NamedScene>, std::less<>> scenes_;
  std::uint64_t next_id_ = 1;
};

}  // namespace gridcast::server
