#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "server/store/sha256.h"

namespace gridcast::server::store {

/// What stays the same over a scene's life.
struct SceneOrigin {
  std::string structure = "auto";  ///< asked for at creation
  double import_ms = 0.0;
  double build_ms = 0.0;
};

/// A scene as the database has it: a snapshot of one version, and the updates after it.
struct SceneRow {
  std::int64_t key = 0;  ///< never used again
  std::string id;
  SceneOrigin origin;
  std::uint64_t snapshot_version = 1;
  Digest snapshot{};          ///< the file that holds it
  std::vector<Digest> files;  ///< that it needs, itself among them
  std::uint64_t version = 1;  ///< the newest
  bool intact = true;         ///< its checksum fits (what it was written as)
};

/// What turns a version into this one: in the row itself, or in a file when it is large.
struct UpdateRow {
  std::uint64_t version = 1;
  std::string delta;
  std::optional<Digest> file;
  bool intact = true;
};

/// Scenes, versions and updates in SQLite: write-ahead log, synchronous=FULL. What a call has written when it
/// returns outlasts a loss of power; a call that fails has changed nothing. Any number of threads may call:
/// writes that wait at the same time share one commit. Errors: kLimitExceeded (disk full), kIo, kInvalidFile
/// (damaged), kUnsupported (written by a newer program), kNotFound (no such scene any more).
class Database {
 public:
  /// Opens or makes it, and brings an older schema up to date.
  [[nodiscard]] static Result<std::unique_ptr<Database>> open(const std::string& path);
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// Takes all but `key` and `intact`; returns the key. `next_number` is kept for the names of later scenes.
  [[nodiscard]] Result<std::int64_t> create(const SceneRow& scene, std::uint64_t next_number);
  [[nodiscard]] Status append(std::int64_t key, const UpdateRow& update);
  [[nodiscard]] Status erase(std::int64_t key);
  /// A newer snapshot in place of the old one and of the updates up to it.
  [[nodiscard]] Status compact(std::int64_t key, std::uint64_t version, const Digest& snapshot,
                               const std::vector<Digest>& files);

  [[nodiscard]] Result<std::vector<SceneRow>> scenes();
  /// After the snapshot, in order.
  [[nodiscard]] Result<std::vector<UpdateRow>> updates(std::int64_t key);
  [[nodiscard]] Result<std::set<Digest>> files_in_use();
  [[nodiscard]] Result<std::uint64_t> next_number();
  [[nodiscard]] std::uint64_t commits() const;

 private:
  struct Impl;
  explicit Database(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace gridcast::server::store
