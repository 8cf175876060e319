#include "server/store/file_io.h"

#include <algorithm>
#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace gridcast::server::store {
namespace {

/// An open file, closed at the end.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  [[nodiscard]] int get() const { return fd_; }
  [[nodiscard]] bool ok() const { return fd_ >= 0; }

 private:
  int fd_;
};

bool write_all(int fd, std::string_view bytes) {
  constexpr std::size_t kMostAtOnce = std::size_t(1) << 30;
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), std::min(bytes.size(), kMostAtOnce));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes.remove_prefix(std::size_t(n));
  }
  return true;
}

}  // namespace

Status write_new_file(const std::string& path, std::initializer_list<std::string_view> pieces) {
  const Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!file.ok()) return system_error("creating", path, errno);
  for (const std::string_view piece : pieces)
    if (!write_all(file.get(), piece)) return system_error("writing", path, errno);
  if (::fsync(file.get()) != 0) return system_error("syncing", path, errno);
  return ok_status();
}

Result<std::string> read_file(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  if (!file.ok()) {
    if (errno == ENOENT) return Error{ErrorCode::kNotFound, path + " is missing", ""};
    return system_error("opening", path, errno);
  }
  struct stat status {};
  if (::fstat(file.get(), &status) != 0) return system_error("reading", path, errno);
  std::string bytes(std::size_t(status.st_size), '\0');
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::read(file.get(), bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_error("reading", path, errno);
    if (n == 0) break;
    done += std::size_t(n);
  }
  bytes.resize(done);
  return bytes;
}

Status sync_folder(const std::string& path) {
  const Descriptor folder(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.ok()) return system_error("opening", path, errno);
  if (::fsync(folder.get()) != 0) return system_error("syncing", path, errno);
  return ok_status();
}

Error system_error(std::string_view doing, const std::string& path, int error_number) {
  const bool full = error_number == ENOSPC || error_number == EDQUOT;
  return {full ? ErrorCode::kLimitExceeded : ErrorCode::kIo,
          std::string(doing) + " " + path + ": " + std::generic_category().message(error_number), ""};
}

}  // namespace gridcast::server::store
