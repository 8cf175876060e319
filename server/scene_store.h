#pragma once

#include <cstdint>
#include <deque>
#include <functional>
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
#include "core/scene/tree_replacement.h"
#include "core/scene/update.h"
#include "proto/error_table.h"
#include "server/scene_log.h"
#include "server/store/scene_archive.h"
#include "server/work_gate.h"

namespace gridcast::server {

using store::SceneOrigin;

class TreeBuilder;

/// What a scene keeps beside its newest version.
struct History {
  std::size_t versions = 1;   ///< the newest among them
  std::size_t log_bytes = 0;  ///< of the updates that led to it
};

/// A named scene: pointers to its newest snapshots, and one writer at a time, in the order of arrival.
/// Readers never wait for a writer's work nor a writer for readers: the pointers alone are guarded. A version
/// is freed when it is no longer kept and its last reader lets go of it.
class NamedScene : public std::enable_shared_from_this<NamedScene> {
 public:
  /// Where a scene is stored.
  struct Stored {
    store::SceneArchive* archive = nullptr;  ///< null: in memory alone
    std::int64_t key = 0;
  };

  /// `trees` builds what updates leave to the background; null: nobody does.
  NamedScene(std::string id, std::shared_ptr<const scene::Scene> first, SceneOrigin origin, Stored stored,
             TreeBuilder* trees, const History& history = {})
      : id_(std::move(id)),
        origin_(std::move(origin)),
        stored_(stored),
        trees_(trees),
        max_kept_(history.versions),
        versions_{first},
        log_(first->version(), history.log_bytes),
        kept_{std::move(first)} {}

  [[nodiscard]] const std::string& id() const { return id_; }
  [[nodiscard]] const SceneOrigin& origin() const { return origin_; }
  [[nodiscard]] std::shared_ptr<const scene::Scene> snapshot() const;
  /// version_gone when it is no longer kept, version_not_found when there is none yet.
  [[nodiscard]] std::variant<std::shared_ptr<const scene::Scene>, proto::Problem> snapshot_at(
      std::uint64_t version) const;

  /// Applies `edits` and publishes the new version, when `if_match` (an If-Match header, empty = none) names
  /// the current one. It is stored before anyone sees it, whatever the edits are: this is the one place where
  /// a version comes about. On any problem nothing changed. kCancelled when `stop` comes before this writer's
  /// turn.
  [[nodiscard]] std::variant<scene::UpdateResult, proto::Problem, Error> update(
      std::string_view if_match, const SharedEdits& edits, const std::stop_token& stop = {});
  [[nodiscard]] std::variant<scene::UpdateResult, proto::Problem, Error> update(
      std::string_view if_match, std::vector<scene::SceneEdit> edits, const std::stop_token& stop = {}) {
    return update(if_match, std::make_shared<const std::vector<scene::SceneEdit>>(std::move(edits)), stop);
  }

  /// Puts a better tree into the newest version (scene::replace_tree): nothing but speed changes, so the
  /// version stays and nothing is stored. Why it was of no use, if so. kCancelled when `stop` or the end of
  /// the scene comes first.
  [[nodiscard]] Result<std::optional<scene::TreeRefusal>> replace_tree(std::uint32_t mesh_id,
                                                                       const blas::Blas& tree,
                                                                       const std::stop_token& stop);
  /// Says when the scene is erased.
  [[nodiscard]] std::stop_token gone() const { return gone_.get_token(); }

  /// What was kept at one moment.
  struct Kept {
    std::uint64_t oldest = 0, newest = 0;  ///< versions that can be asked for, none missing between them
    std::uint64_t log_since = 0;           ///< the log has all that came after this version
    std::size_t log_bytes = 0;
  };
  [[nodiscard]] Kept kept() const;
  struct LogPart {
    std::vector<LogLine> lines;
    std::uint64_t newest = 0;  ///< version of the scene at that moment
  };
  /// At most `limit` updates after `since`. log_gone when the log begins later, version_not_found when there
  /// is no such version yet.
  [[nodiscard]] std::variant<LogPart, proto::Problem> log_after(std::uint64_t since, std::size_t limit) const;
  /// Keeps the newest version alone, and an empty log.
  void drop_history();

  /// Versions in memory: the newest, those kept and those that queries still read. One that got a better tree
  /// while it was read counts twice.
  [[nodiscard]] std::size_t live_versions() const;

 private:
  friend class SceneStore;
  /// `edits` made the version of `scene`; null: the newest version has a better tree.
  void publish(std::shared_ptr<const scene::Scene> scene, const SharedEdits& edits);
  std::string id_;
  SceneOrigin origin_;
  Stored stored_;
  TreeBuilder* trees_;
  std::stop_source gone_;
  WorkGate writing_{1};
  bool erased_ = false;  ///< guarded by a turn of writing_
  const std::size_t max_kept_;
  mutable std::mutex pointer_;  ///< guards what follows
  std::vector<std::weak_ptr<const scene::Scene>>
      versions_;  ///< the newest, and older ones not known to be gone
  SceneLog log_;
  std::deque<std::shared_ptr<const scene::Scene>> kept_;  ///< without a gap, the newest last
};

/// Nothing when If-Match allows a write to `version`.
[[nodiscard]] std::optional<proto::Problem> check_if_match(std::string_view if_match, std::uint64_t version);

/// A stored scene that cannot be served.
struct DamagedScene {
  std::string id;
  std::string detail;  ///< for the operator: names files
};

/// All scenes of a server, by id. With an archive each outlasts the process: create, update and erase return
/// when the change is stored.
class SceneStore {
 public:
  /// The stored scenes are there at once, and can be served when restore() has come to them. Without `trees`
  /// updates leave nothing to the background.
  explicit SceneStore(std::size_t max_scenes, store::SceneArchive* archive = nullptr,
                      TreeBuilder* trees = nullptr, const History& history = {});

  /// Letters, digits, '_', '.' and '-', 1 to 64 of them, not "." or "..".
  [[nodiscard]] static bool is_valid_id(std::string_view id);

  /// Builds what is stored, one scene after the other, and tells of each that is damaged. Once, before the
  /// server says that it is ready.
  void restore(const std::stop_token& stop, const std::function<void(const DamagedScene&)>& tell);

  /// Nothing when a scene could be created under `id` now: for refusing before the work is done.
  [[nodiscard]] std::optional<proto::Problem> check_new(std::string_view id) const;
  /// An empty id gets the next free of s1, s2, ...
  [[nodiscard]] std::variant<std::shared_ptr<NamedScene>, proto::Problem> create(
      std::string id, std::shared_ptr<const scene::Scene> first, SceneOrigin origin);
  [[nodiscard]] std::shared_ptr<NamedScene> find(std::string_view id) const;
  /// Why find() has nothing: no such scene, not restored yet, damaged.
  [[nodiscard]] proto::Problem why_missing(std::string_view id) const;
  /// In the order of their ids.
  [[nodiscard]] std::vector<std::shared_ptr<NamedScene>> list() const;
  [[nodiscard]] std::vector<std::string> damaged() const;
  /// Of every scene: see NamedScene.
  void drop_history();
  /// Requests at work on the scene finish on it; updates that wait for their turn find it gone. A damaged
  /// scene can be erased too.
  [[nodiscard]] std::optional<proto::Problem> erase(std::string_view id, std::string_view if_match);

 private:
  enum class State : std::uint8_t { kCreating, kStored, kDamaged, kServed };
  struct Entry {
    State state = State::kCreating;
    std::shared_ptr<NamedScene> scene;  ///< kServed
    std::int64_t key = 0;               ///< in the archive
  };

  std::variant<std::string, proto::Problem> reserve(std::string id);
  void settle(const std::string& id, Entry entry);
  /// Serves it, and has the trees built that it lacks.
  void serve(const std::shared_ptr<NamedScene>& scene, std::int64_t key);
  std::optional<proto::Problem> erase_damaged(std::string_view id, std::int64_t key);

  std::size_t max_scenes_;
  store::SceneArchive* archive_;
  TreeBuilder* trees_;
  History history_;
  std::vector<store::SceneRow> rows_;  ///< to be restored
  mutable std::mutex mutex_;
  std::map<std::string, Entry, std::less<>> scenes_;
  std::uint64_t next_number_ = 1;
};

}  // namespace gridcast::server
