#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <string_view>

#include "core/blas/blas.h"
#include "server/store/file_io.h"
#include "server/store/sha256.h"

namespace gridcast::server::store {

/// What a built tree is found by: all that it is built from. `mesh` is the SHA-256 of the mesh's bytes, as
/// the store writes it.
[[nodiscard]] Digest tree_key(const Digest& mesh, const blas::BuildOptions& options);

/// A tree's file in memory.
class TreeFile {
 public:
  TreeFile(std::string bytes, std::size_t head_bytes) : bytes_(std::move(bytes)), head_bytes_(head_bytes) {}
  [[nodiscard]] std::string_view tree() const { return std::string_view(bytes_).substr(head_bytes_); }

 private:
  std::string bytes_;
  std::size_t head_bytes_;
};

/// A folder of built trees, each in a file that is named by its key and checked against a checksum that it
/// holds. Nothing depends on it: any file may go, and what is wrong is as good as not there. Together they
/// take at most `limit_bytes`; the ones that were used longest ago go first. Any number of threads may use
/// one.
class TreeFiles {
 public:
  TreeFiles(std::string folder, std::uint64_t limit_bytes)
      : folder_(std::move(folder)), limit_bytes_(limit_bytes) {}

  /// Makes the folder when it is missing, and removes what an interrupted put left behind.
  [[nodiscard]] Status open();

  [[nodiscard]] bool contains(const Digest& key) const;
  /// kNotFound, or why the file is not what was put: kInvalidFile, kUnsupported (of another version), kIo.
  [[nodiscard]] Result<TreeFile> get(const Digest& key);
  /// kLimitExceeded when the disk is full or the tree is larger than all of them may be; kIo.
  [[nodiscard]] Status put(const Digest& key, std::string_view tree);
  void remove(const Digest& key);
  void keep_only(const std::set<Digest>& wanted);

  [[nodiscard]] std::string path_of(const Digest& key) const { return folder_ + "/" + to_hex(key); }
  [[nodiscard]] std::uint64_t bytes() const;
  [[nodiscard]] bool empty() const;

 private:
  struct Entry {
    std::uint64_t bytes = 0;
    std::int64_t used_ns = 0;  ///< when last, by the file's time
  };

  void remove_locked(std::map<Digest, Entry>::iterator entry);
  /// Room for so many bytes more.
  void make_room(std::uint64_t bytes);

  std::string folder_;
  std::uint64_t limit_bytes_;
  std::atomic<std::uint64_t> next_temporary_{0};
  mutable std::mutex mutex_;  ///< guards what follows
  std::map<Digest, Entry> entries_;
  std::uint64_t bytes_ = 0;
};

}  // namespace gridcast::server::store
