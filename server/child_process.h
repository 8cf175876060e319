#pragma once
// Another program, run to its end: its input and output lie in memory, and it gets nothing else of ours.

#include <cstddef>
#include <cstdint>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace gridcast::server {

/// A file in memory without a name. Input and output of a child need no pipes then, which could fill up.
class MemoryFile {
 public:
  explicit MemoryFile(const char* name);
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// False when there is no memory for it.
  [[nodiscard]] bool is_open() const { return descriptor_ >= 0; }
  [[nodiscard]] std::uint64_t size_bytes() const;

  /// False when there is no memory. Leaves the place for reading at the begin.
  [[nodiscard]] bool write_all(std::initializer_list<std::string_view> pieces) const;
  [[nodiscard]] std::vector<std::byte> read_all() const;

 private:
  int descriptor_;
};

/// A file that can be read as memory, as long as this lives. Whoever else holds the file must not shorten it.
class MappedFile {
 public:
  /// `bytes` from the begin on.
  MappedFile(int descriptor, std::size_t bytes);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  /// Empty when it could not be mapped.
  [[nodiscard]] std::string_view text() const { return {static_cast<const char*>(data_), size_}; }

 private:
  void* data_ = nullptr;
  std::size_t size_ = 0;
};

struct ChildCommand {
  std::vector<std::string> arguments;    ///< the first is the program: a path, or a name to be found on PATH
  std::vector<std::string> environment;  ///< NAME=VALUE, all of it
  const MemoryFile& in;
  const MemoryFile& out;
  const MemoryFile& messages;  ///< its standard error; no other descriptor of ours is open in it
};

struct ChildEnd {
  int exit_code = 0;  ///< where it ended by itself
  int signal = 0;     ///< that ended it, else 0
  [[nodiscard]] bool went_well() const { return exit_code == 0 && signal == 0; }
};

/// Starts it, with no signal blocked or handled, and waits; on `stop` it is killed and the end comes at once.
/// It is never left behind, not even as a zombie. kNotFound when there is no such program, kIo when it cannot
/// be started.
[[nodiscard]] Result<ChildEnd> run_child(const ChildCommand& command, const std::stop_token& stop);

/// The environment of this program, with `setting` (NAME=VALUE) in place of what NAME was.
[[nodiscard]] std::vector<std::string> environment_with(const std::string& setting);

}  // namespace gridcast::server
