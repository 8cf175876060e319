#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "server/store/file_io.h"
#include "server/store/sha256.h"

namespace gridcast::server::store {

/// Files of a folder that are named by the SHA-256 of what they hold: written once, never changed.
/// Any number of threads may use one.
class FileStore {
 public:
  /// `folder` exists and belongs to this process alone.
  explicit FileStore(std::string folder) : folder_(std::move(folder)) {}

  /// Once it returns, the bytes outlast a loss of power: temporary name, fsync, rename, fsync of the folder.
  /// kLimitExceeded when the disk is full, kIo on any other failure.
  [[nodiscard]] Result<Digest> put(std::string_view bytes);
  /// The bytes, checked against their name. kNotFound, kInvalidFile (they are not what was put), kIo.
  [[nodiscard]] Result<std::string> get(const Digest& digest) const;
  [[nodiscard]] bool contains(const Digest& digest) const;
  /// Not an error when it is not there.
  void remove(const Digest& digest);
  /// Every file; removes what an interrupted put left behind.
  [[nodiscard]] Result<std::vector<Digest>> sweep();

  [[nodiscard]] std::uint64_t bytes_written() const { return bytes_written_; }

 private:
  [[nodiscard]] std::string path_of(const Digest& digest) const { return folder_ + "/" + to_hex(digest); }

  std::string folder_;
  std::atomic<std::uint64_t> next_temporary_{0};
  std::atomic<std::uint64_t> bytes_written_{0};
};

}  // namespace gridcast::server::store
