#pragma once

#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <shared_mutex>
#include <string>
#include <thread>
#include <vector>

#include "core/scene/scene_state.h"
#include "server/store/database.h"
#include "server/store/file_store.h"
#include "server/store/tree_keeper.h"

namespace gridcast::server::store {

struct ArchiveOptions {
  /// Updates of a scene are folded into a new snapshot when they take more than this, and more than the last
  /// snapshot did: so writing stays linear, and what a start has to replay is bounded.
  std::uint64_t log_bytes = std::uint64_t(4) << 20;
  TreeKeeperOptions trees;
};

struct ArchiveCounts {
  std::uint64_t commits = 0;
  std::uint64_t compactions = 0;
  std::uint64_t failures = 0;       ///< writes that did not get through
  std::uint64_t bytes_written = 0;  ///< to files
  TreeCounts trees;
};

class KnownFiles;

/// Scenes that outlast the process, in a folder: `gridcast.db` and `files/`; and in `structures/` trees that
/// need not be built again. What a call has stored when it returns survives a crash and a loss of power; a
/// call that fails has changed nothing. Any number of threads may call; updates of one scene come one after
/// the other.
class SceneArchive {
 public:
  /// Makes the folder when it is not there; takes it for this process alone. Errors name what is wrong.
  [[nodiscard]] static Result<std::unique_ptr<SceneArchive>> open(const std::string& folder,
                                                                  const ArchiveOptions& options);
  ~SceneArchive();
  SceneArchive(const SceneArchive&) = delete;
  SceneArchive& operator=(const SceneArchive&) = delete;

  /// A scene under a free id; returns its key. `next_number` as Database::create takes it.
  [[nodiscard]] Result<std::int64_t> create(const std::string& id, const SceneOrigin& origin,
                                            const scene::Scene& first, std::uint64_t next_number);
  /// `after` is the version that follows `before`, the newest one that is stored.
  [[nodiscard]] Status append(std::int64_t key, const scene::Scene& before,
                              const std::shared_ptr<const scene::Scene>& after);
  [[nodiscard]] Status erase(std::int64_t key);

  [[nodiscard]] Result<std::vector<SceneRow>> scenes() { return database_->scenes(); }
  [[nodiscard]] Result<std::uint64_t> next_number() { return database_->next_number(); }
  /// The newest version. kInvalidFile or kNotFound when something of it is damaged or missing: says what.
  [[nodiscard]] Result<std::shared_ptr<const scene::Scene>> restore(const SceneRow& row,
                                                                    const std::stop_token& stop);
  /// The scene is served, as it was created or restored.
  void served(std::int64_t key, const std::shared_ptr<const scene::Scene>& scene);
  /// The newest version got another tree, which changes no answer.
  void tree_replaced(std::int64_t key, const std::shared_ptr<const scene::Scene>& scene);
  /// Every scene that could be restored is served.
  void all_restored();
  /// For an orderly end: writes the trees that are not written yet, for at most so long.
  void finish(std::chrono::milliseconds at_most);
  [[nodiscard]] ArchiveCounts counts() const;

 private:
  /// How much there is to replay.
  struct Log {
    std::uint64_t bytes = 0;
    std::uint64_t snapshot_bytes = 0;
  };
  struct Written {
    Digest snapshot{};
    std::vector<Digest> files;
    std::uint64_t bytes = 0;
  };
  SceneArchive(std::string folder, int lock_fd, const ArchiveOptions& options);
  Status counted(Status status);
  Result<Digest> put_known(const std::shared_ptr<const void>& thing, std::uint64_t& bytes,
                           const std::function<std::string()>& encoded);
  Result<Written> write_snapshot(const scene::Scene& scene);
  Result<scene::SceneState> read_state(const SceneRow& row, Log& log);
  Result<scene::SceneState> read_snapshot(const SceneRow& row, Log& log);
  Result<std::shared_ptr<const mesh::TriangleMesh>> read_mesh(
      const Digest& digest, std::map<Digest, std::shared_ptr<const mesh::TriangleMesh>>& read);
  Digest digest_of(const std::shared_ptr<const mesh::TriangleMesh>& mesh);
  void grown(std::int64_t key, std::uint64_t bytes, const std::shared_ptr<const scene::Scene>& after);
  void maintain(const std::stop_token& stop);
  void compact(std::int64_t key, const std::shared_ptr<const scene::Scene>& scene);
  /// Removes files that nothing refers to.
  Status collect_garbage();

  std::string folder_;
  int lock_fd_;
  ArchiveOptions options_;
  FileStore files_;
  std::unique_ptr<Database> database_;
  /// Held shared from the writing of a file until the commit that refers to it: no file goes meanwhile.
  std::shared_mutex referring_;
  std::unique_ptr<KnownFiles> known_;  ///< so that nothing is written twice

  mutable std::mutex mutex_;  ///< of what follows
  std::map<std::int64_t, Log> logs_;
  std::map<std::int64_t, std::shared_ptr<const scene::Scene>> due_;  ///< for compaction
  bool garbage_ = false;                                             ///< files may be without a reference
  std::uint64_t compactions_ = 0;
  std::uint64_t failures_ = 0;
  std::condition_variable_any changed_;
  std::unique_ptr<TreeKeeper> trees_;  ///< null: none are kept
  std::jthread maintenance_;           // last: uses the rest
};

}  // namespace gridcast::server::store
