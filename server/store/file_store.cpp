#include "server/store/file_store.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace gridcast::server::store {
namespace {

constexpr std::string_view kTemporary = "tmp-";

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

Status write_new_file(const std::string& path, std::string_view bytes) {
  const Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!file.ok()) return system_error("creating", path, errno);
  if (!write_all(file.get(), bytes)) return system_error("writing", path, errno);
  if (::fsync(file.get()) != 0) return system_error("syncing", path, errno);
  return ok_status();
}

}  // namespace

Error system_error(std::string_view doing, const std::string& path, int error_number) {
  const bool full = error_number == ENOSPC || error_number == EDQUOT;
  return {full ? ErrorCode::kLimitExceeded : ErrorCode::kIo,
          std::string(doing) + " " + path + ": " + std::generic_category().message(error_number), ""};
}

Status sync_folder(const std::string& path) {
  const Descriptor folder(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder.ok()) return system_error("opening", path, errno);
  if (::fsync(folder.get()) != 0) return system_error("syncing", path, errno);
  return ok_status();
}

Result<Digest> FileStore::put(std::string_view bytes) {
  const Digest digest = sha256(bytes);
  const std::string path = path_of(digest);
  // What is there already may be damaged, and another thread may not have come to syncing its name.
  if (!get(digest)) {
    const std::string temporary = folder_ + "/" + std::string(kTemporary) + std::to_string(next_temporary_++);
    Status written = write_new_file(temporary, bytes);
    if (written && ::rename(temporary.c_str(), path.c_str()) != 0)
      written = system_error("renaming", temporary, errno);
    if (!written) {
      ::unlink(temporary.c_str());
      return written.error();
    }
    bytes_written_ += bytes.size();
  }
  if (Status synced = sync_folder(folder_); !synced) return synced.error();
  return digest;
}

Result<std::string> FileStore::get(const Digest& digest) const {
  const std::string path = path_of(digest);
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
  if (done != bytes.size() || sha256(bytes) != digest)
    return Error{ErrorCode::kInvalidFile, path + " is damaged: its checksum is not its name", ""};
  return bytes;
}

bool FileStore::contains(const Digest& digest) const {
  return ::access(path_of(digest).c_str(), R_OK) == 0;
}

void FileStore::remove(const Digest& digest) {
  ::unlink(path_of(digest).c_str());
}

Result<std::vector<Digest>> FileStore::sweep() {
  std::vector<Digest> found;
  std::error_code failed;
  for (std::filesystem::directory_iterator entry(folder_, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(kTemporary)) {
      ::unlink(entry->path().c_str());
    } else if (const auto digest = parse_hex(name)) {
      found.push_back(*digest);
    }
  }
  if (failed) return system_error("listing", folder_, failed.value());
  return found;
}

}  // namespace gridcast::server::store
