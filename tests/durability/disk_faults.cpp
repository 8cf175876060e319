// A library to be preloaded (LD_PRELOAD) into a server under test: counts the calls that change a folder and,
// as the environment says, kills the process before one of them, makes them fail, or keeps aside what a loss
// of power would leave.
//   DISK_FAULTS_ROOT     the folder; calls on other files pass
//   DISK_FAULTS_KILL_AT  SIGKILL to itself before the call of this number, from 1 on
//   DISK_FAULTS_KILL_ON  and DISK_FAULTS_ARMED, a file: SIGKILL to itself before the first call of this name
//                        ("rename file": CALL PLACE) while that file exists. Places are `folder`, `journal`
//                        (the database's write-ahead log), `database` and `file`, which is every other
//   DISK_FAULTS_ERROR    a file: while it exists writes and syncs fail, with ENOSPC when it is empty, else
//   EIO DISK_FAULTS_SYNCED   a folder for what has been synced: DIR/data/INODE, and DIR/names with the lines
//                        "INODE PATH" of every synced folder. Nothing else is on the disk after a power loss
//                        in the worst case.

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <string>

#include <dlfcn.h>
#include <sys/stat.h>
#include <unistd.h>

namespace {

namespace fs = std::filesystem;

std::string setting(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::string() : std::string(value);
}

std::string path_of(int fd) {
  char path[4096];
  const ssize_t size = ::readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), path, sizeof(path));
  return size <= 0 ? std::string() : std::string(path, std::size_t(size));
}

bool exists(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0;
}

std::string place_of(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode)) return "folder";
  if (path.ends_with("-wal")) return "journal";
  return path.find(".db") == std::string::npos ? "file" : "database";
}

/// One call at a time: what is kept aside is a state that was.
struct Disk {
  std::recursive_mutex mutex;
  const std::string root = setting("DISK_FAULTS_ROOT");
  const std::string synced = setting("DISK_FAULTS_SYNCED");
  const std::string error = setting("DISK_FAULTS_ERROR");
  const std::string armed = setting("DISK_FAULTS_ARMED"), kill_on = setting("DISK_FAULTS_KILL_ON");
  const long kill_at = std::atol(setting("DISK_FAULTS_KILL_AT").c_str());
  long calls = 0;
  std::map<std::string, std::map<std::string, ino_t>> names;
  bool inside = false;

  bool watches(const std::string& path) const { return !inside && !root.empty() && path.rfind(root, 0) == 0; }
  /// Counts a call; true when it is to fail, with errno set.
  bool fails(const char* call, const std::string& path) {
    if (!watches(path)) return false;
    const bool is_named =
        !kill_on.empty() && exists(armed) && kill_on == std::string(call).append(" ").append(place_of(path));
    if (++calls == kill_at || is_named) ::kill(::getpid(), SIGKILL);
    struct stat status {};
    if (error.empty() || ::stat(error.c_str(), &status) != 0) return false;
    errno = status.st_size == 0 ? ENOSPC : EIO;
    return true;
  }
  void keep_aside(int fd) {
    const std::string path = path_of(fd);
    if (synced.empty() || !watches(path)) return;
    inside = true;
    struct stat status {};
    ::fstat(fd, &status);
    if (S_ISDIR(status.st_mode)) {
      auto& listing = names[path];
      listing.clear();
      for (const auto& entry : fs::directory_iterator(path)) {
        struct stat one {};
        if (entry.is_regular_file() && ::stat(entry.path().c_str(), &one) == 0)
          listing[entry.path().string()] = one.st_ino;
      }
      std::ofstream file(synced + "/names");
      for (const auto& [folder, entries] : names)
        for (const auto& [name, inode] : entries) file << inode << ' ' << name << '\n';
    } else {
      fs::create_directories(synced + "/data");
      std::error_code ignored;
      fs::copy_file(path, synced + "/data/" + std::to_string(status.st_ino),
                    fs::copy_options::overwrite_existing, ignored);
    }
    inside = false;
  }
};

Disk& disk() {
  static Disk one;
  return one;
}

template <class F>
F* next(const char* name) {
  return reinterpret_cast<F*>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

ssize_t write(int fd, const void* data, size_t size) {
  const std::lock_guard lock(disk().mutex);
  static auto* real = next<ssize_t(int, const void*, size_t)>("write");
  return disk().fails("write", path_of(fd)) ? -1 : real(fd, data, size);
}
ssize_t pwrite64(int fd, const void* data, size_t size, off64_t at) {
  const std::lock_guard lock(disk().mutex);
  static auto* real = next<ssize_t(int, const void*, size_t, off64_t)>("pwrite64");
  return disk().fails("write", path_of(fd)) ? -1 : real(fd, data, size, at);
}
int fsync(int fd) {
  const std::lock_guard lock(disk().mutex);
  static auto* real = next<int(int)>("fsync");
  if (disk().fails("sync", path_of(fd))) return -1;
  const int result = real(fd);
  disk().keep_aside(fd);
  return result;
}
int fdatasync(int fd) {
  const std::lock_guard lock(disk().mutex);
  static auto* real = next<int(int)>("fdatasync");
  if (disk().fails("sync", path_of(fd))) return -1;
  const int result = real(fd);
  disk().keep_aside(fd);
  return result;
}
int rename(const char* from, const char* to) {
  const std::lock_guard lock(disk().mutex);
  static auto* real = next<int(const char*, const char*)>("rename");
  return disk().fails("rename", to) ? -1 : real(from, to);
}
int unlink(const char* path) {
  const std::lock_guard lock(disk().mutex);
  static auto* real = next<int(const char*)>("unlink");
  return disk().fails("unlink", path) ? -1 : real(path);
}
int ftruncate64(int fd, off64_t size) {
  const std::lock_guard lock(disk().mutex);
  static auto* real = next<int(int, off64_t)>("ftruncate64");
  return disk().fails("truncate", path_of(fd)) ? -1 : real(fd, size);
}

}  // extern "C"
