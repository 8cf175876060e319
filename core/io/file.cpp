#include <atomic>
#include <cerrno>
#include <cstdio>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/io/image.h"

namespace gridcast::io {
namespace {

Error io_error(const std::string& what, const std::filesystem::path& path, int error) {
  const ErrorCode code = error == ENOENT || error == ENOTDIR ? ErrorCode::kNotFound : ErrorCode::kIo;
  std::string message = what;
  message.append(" '").append(path.string()).append("': ").append(std::generic_category().message(error));
  return {code, std::move(message), ""};
}

/// A descriptor that is closed on every way out.
class File {
 public:
  File(const std::filesystem::path& path, int flags) : descriptor_(open(path.c_str(), flags, 0666)) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  [[nodiscard]] int get() const { return descriptor_; }
  [[nodiscard]] bool is_open() const { return descriptor_ >= 0; }

 private:
  int descriptor_;
};

/// Writes everything and waits until it is on the disk; 0 or an errno.
int write_and_sync(int descriptor, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes = bytes.subspan(std::size_t(written));
  }
  return fsync(descriptor) == 0 ? 0 : errno;
}

/// A name beside `path` that no other writer uses: unique among processes by the id, within one by a counter.
std::filesystem::path temporary_name(const std::filesystem::path& path) {
  static std::atomic<unsigned> counter{0};
  std::filesystem::path name = path;
  name += std::string(".part-").append(std::to_string(getpid())).append("-");
  name += std::to_string(counter.fetch_add(1));
  return name;
}

}  // namespace

Status write_file(const std::filesystem::path& path, std::span<const std::byte> bytes) {
  const std::filesystem::path temporary = temporary_name(path);
  int error = 0;
  {
    // A leftover of that name is from a process that died: ours to replace.
    const File file(temporary, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW);
    if (!file.is_open()) return io_error("cannot write", path, errno);
    error = write_and_sync(file.get(), bytes);
  }
  if (error == 0 && std::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) {
    unlink(temporary.c_str());
    return io_error("cannot write", path, error);
  }
  // The new name itself is durable only when its folder is. Some file systems cannot sync folders; the
  // file is whole either way.
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  const File directory(folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory.is_open()) fsync(directory.get());
  return ok_status();
}

Result<std::vector<std::byte>> read_file(const std::filesystem::path& path, std::size_t max_bytes) {
  // Non-blocking, or opening a pipe that nobody writes to would never return.
  const File file(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (!file.is_open()) return io_error("cannot read", path, errno);
  struct stat info {};
  if (fstat(file.get(), &info) != 0) return io_error("cannot read", path, errno);
  if (!S_ISREG(info.st_mode)) {
    return Error{ErrorCode::kInvalidArgument, path.string().append(" is not a regular file"), ""};
  }
  const Error too_large{
      ErrorCode::kLimitExceeded,
      path.string().append(" is larger than ").append(std::to_string(max_bytes)).append(" bytes"), ""};
  if (std::size_t(info.st_size) > max_bytes) return too_large;

  // The size may change while we read: what counts is what arrives.
  std::vector<std::byte> bytes(std::size_t(info.st_size));
  std::size_t filled = 0;
  for (;;) {
    if (filled == bytes.size()) bytes.resize(filled + 4096);
    const ssize_t got = read(file.get(), bytes.data() + filled, bytes.size() - filled);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return io_error("cannot read", path, errno);
    if (got == 0) break;
    filled += std::size_t(got);
    if (filled > max_bytes) return too_large;
  }
  bytes.resize(filled);
  return bytes;
}

}  // namespace gridcast::io
