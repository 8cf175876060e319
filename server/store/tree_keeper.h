#pragma once
// Built trees of stored scenes, kept so that a restart need not build them again.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>

#include "core/scene/scene_state.h"
#include "server/store/tree_files.h"

namespace gridcast::server::store {

struct TreeKeeperOptions {
  std::uint64_t bytes = std::uint64_t(8) << 30;  ///< of all files together; 0 keeps none
  /// Smaller meshes are built as fast as a file is opened.
  std::size_t least_triangles = 1024;
  /// The trees of meshes that move are written when nothing has changed for so long.
  std::chrono::milliseconds rest{10'000};
};

struct TreeCounts {
  std::uint64_t found = 0;     ///< trees that a restart did not have to build
  std::uint64_t kept = 0;      ///< that were written
  std::uint64_t rejected = 0;  ///< files that were not what they should be
  std::uint64_t failures = 0;  ///< trees that could not be written
  std::uint64_t bytes = 0;     ///< of all files, now
};

/// What an update did to the trees of a scene.
enum class TreeChange : std::uint8_t {
  kNew,    ///< all of them are new to the keeper
  kMoved,  ///< some are others, and may soon be others again
  kNone
};

/// Writes the trees of scenes in the background and finds them again. It may fail at anything: then the log
/// says so, and trees are built. Any number of threads may call.
class TreeKeeper {
 public:
  /// The SHA-256 of a mesh as the store writes it.
  using DigestOf = std::function<Digest(const std::shared_ptr<const mesh::TriangleMesh>&)>;

  /// Null when the folder cannot be used; the log says why.
  [[nodiscard]] static std::unique_ptr<TreeKeeper> open(const std::string& folder,
                                                        const TreeKeeperOptions& options, DigestOf digest_of);
  TreeKeeper(const TreeKeeper&) = delete;
  TreeKeeper& operator=(const TreeKeeper&) = delete;

  /// For restore_scene. `asked` is the quality that the scene's trees are meant to have.
  [[nodiscard]] scene::TreeFinder finder(std::int64_t scene_key, blas::BuildQuality asked);

  /// `scene` is the newest state of its scene: its trees are written, new ones soon, others when the scene
  /// has come to rest.
  void published(std::int64_t scene_key, const std::shared_ptr<const scene::Scene>& scene, TreeChange change);
  /// Its trees go.
  void erased(std::int64_t scene_key);
  /// Every stored scene was published or is damaged: trees that no scene has may go from now on.
  void all_restored();
  /// Writes what waits, for about so long at most, and stops. For an orderly end: without it what waits is
  /// not kept.
  void finish(std::chrono::milliseconds at_most);

  [[nodiscard]] TreeCounts counts() const;

 private:
  using Clock = std::chrono::steady_clock;
  using Stop = std::function<bool()>;

  struct Waiting {
    std::weak_ptr<const scene::Scene> scene;
    Clock::time_point due;
  };

  TreeKeeper(const std::string& folder, const TreeKeeperOptions& options, DigestOf digest_of);
  void work(const std::stop_token& stop);
  [[nodiscard]] Clock::time_point next_due() const;
  /// These two let go of `lock`, which is mutex_'s, for the work. Whether one was due by `now`.
  bool keep_one(std::unique_lock<std::mutex>& lock, Clock::time_point now, const Stop& stop);
  bool remove_unwanted(std::unique_lock<std::mutex>& lock);

  // Without the mutex:
  /// The keys of a scene's trees, all of which were written or tried; none when it was stopped before the
  /// end.
  std::optional<std::set<Digest>> keep(const scene::Scene& scene, const Stop& stop);
  void write(const Digest& key, const blas::Blas& blas);
  std::optional<blas::Blas> find(std::int64_t scene_key, const scene::MeshState& wanted,
                                 blas::BuildQuality asked);
  std::optional<blas::Blas> read(const Digest& key, const Digest& mesh_digest,
                                 const std::shared_ptr<const mesh::TriangleMesh>& mesh);
  void reject(const Digest& key, const std::string& why);

  TreeKeeperOptions options_;
  DigestOf digest_of_;
  TreeFiles files_;
  mutable std::mutex mutex_;  ///< guards what follows
  std::map<std::int64_t, Waiting> waiting_;
  std::map<std::int64_t, std::set<Digest>> wanted_;  ///< by scene
  std::int64_t at_work_ = 0;                         ///< the scene whose trees are being written
  bool all_restored_ = false;
  bool unwanted_ = false;  ///< there may be trees that no scene has
  TreeCounts counts_;
  std::uint64_t changes_ = 0;
  std::condition_variable_any changed_;
  std::jthread thread_;  // last: uses the rest
};

}  // namespace gridcast::server::store
