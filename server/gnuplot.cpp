#include "server/gnuplot.h"

#include <cerrno>
#include <csignal>
#include <cstring>

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace gridcast::server {
namespace {

/// Longest message of gnuplot that is passed on.
constexpr std::size_t kMaxMessage = 400;

Error failed(const char* what) {
  return {ErrorCode::kIo, std::string("gnuplot could not be run: ") + what + ": " + std::strerror(errno), ""};
}

/// A file in memory without a name. Input and output of a child need no pipes then, which could fill up.
class MemoryFile {
 public:
  explicit MemoryFile(const char* name) : descriptor_(memfd_create(name, MFD_CLOEXEC)) {}
  ~MemoryFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  [[nodiscard]] int descriptor() const { return descriptor_; }

  /// False when there is no memory. Leaves the place for reading at the begin.
  [[nodiscard]] bool write_all(const std::string& text) const {
    for (std::size_t at = 0; at < text.size();) {
      const ssize_t written = write(descriptor_, text.data() + at, text.size() - at);
      if (written <= 0) return false;
      at += std::size_t(written);
    }
    return lseek(descriptor_, 0, SEEK_SET) == 0;
  }

  [[nodiscard]] std::vector<std::byte> read_all() const {
    struct stat about {};
    if (fstat(descriptor_, &about) != 0) return {};
    std::vector<std::byte> bytes(std::size_t(about.st_size));
    for (std::size_t at = 0; at < bytes.size();) {
      const ssize_t got = pread(descriptor_, bytes.data() + at, bytes.size() - at, off_t(at));
      if (got <= 0) return {};
      at += std::size_t(got);
    }
    return bytes;
  }

 private:
  int descriptor_;
};

/// The environment of the program, but numbers are written with points.
std::vector<char*> environment() {
  static char locale[] = "LC_ALL=C.UTF-8";
  std::vector<char*> list;
  for (char** entry = environ; *entry != nullptr; ++entry)
    if (std::strncmp(*entry, "LC_ALL=", 7) != 0) list.push_back(*entry);
  list.push_back(locale);
  list.push_back(nullptr);
  return list;
}

/// 0, or why the program could not be started.
int spawn(pid_t& child, char* const* arguments, const MemoryFile& in, const MemoryFile& out,
          const MemoryFile& messages) {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&files);
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_adddup2(&files, in.descriptor(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&files, out.descriptor(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&files, messages.descriptor(), STDERR_FILENO);
  // Whoever waits for the end of a connection of ours does not wait for the child.
  posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
  // Our threads block the signals that one of them waits for; the child takes them.
  sigset_t none;
  sigemptyset(&none);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  const int error = posix_spawnp(&child, arguments[0], &files, &attributes, arguments, environment().data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  return error;
}

/// Waits for the child to end, and ends it on a stop. True when it said that all went well.
bool wait_for(pid_t child, const std::stop_token& stop) {
  {
    // It stays a zombie until it is reaped below, so the number cannot become another process's.
    // It has nothing to tidy up, and nothing that it does can hold this one back.
    const std::stop_callback end_it(stop, [child] { kill(child, SIGKILL); });
    siginfo_t info{};
    while (waitid(P_PID, id_t(child), &info, WEXITED | WNOWAIT) != 0 && errno == EINTR) {
    }
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

Result<std::vector<std::byte>> run(const std::string& argument, const std::string& input,
                                   const std::stop_token& stop) {
  const MemoryFile in("script"), out("drawing"), messages("messages");
  if (in.descriptor() < 0 || out.descriptor() < 0 || messages.descriptor() < 0 || !in.write_all(input))
    return failed("memory for its data");
  std::string program = "gnuplot", option = argument;
  char* const arguments[] = {program.data(), option.data(), nullptr};
  pid_t child = 0;
  if (const int error = spawn(child, arguments, in, out, messages); error != 0) {
    if (error == ENOENT || error == EACCES)
      return Error{ErrorCode::kUnsupported,
                   "drawing SVG and PNG needs the program gnuplot, which is not on PATH: install the Debian "
                   "package gnuplot-nox; .json, .csv and .vl.json need nothing",
                   ""};
    errno = error;
    return failed("starting it");
  }
  const bool went_well = wait_for(child, stop);
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the drawing was stopped", ""};
  if (went_well) return out.read_all();
  const auto said = messages.read_all();
  const std::string text(reinterpret_cast<const char*>(said.data()), std::min(said.size(), kMaxMessage));
  return Error{ErrorCode::kInternal, "gnuplot failed: " + text, ""};
}

}  // namespace

Result<std::vector<std::byte>> run_gnuplot(const std::string& script, const std::stop_token& stop) {
  // -d: neither the system's nor the user's settings.
  auto drawn = run("-d", script, stop);
  if (drawn && drawn->empty()) return Error{ErrorCode::kInternal, "gnuplot drew nothing", ""};
  return drawn;
}

Status find_gnuplot() {
  const auto version = run("--version", "", {});
  if (!version) return version.error();
  return ok_status();
}

}  // namespace gridcast::server
