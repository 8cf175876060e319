#include "server/child_process.h"

#include <cerrno>
#include <csignal>
#include <cstring>

#include <spawn.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace gridcast::server {
namespace {

/// As the C interfaces want them.
std::vector<char*> pointers_to(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

/// 0, or why it could not be started.
int spawn(pid_t& child, const ChildCommand& command) {
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  posix_spawn_file_actions_init(&files);
  posix_spawnattr_init(&attributes);
  posix_spawn_file_actions_adddup2(&files, command.in.descriptor(), STDIN_FILENO);
  posix_spawn_file_actions_adddup2(&files, command.out.descriptor(), STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&files, command.messages.descriptor(), STDERR_FILENO);
  // Whoever waits for the end of a connection of ours does not wait for the child.
  posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
  // Our threads block the signals that one of them waits for, and ignore others; the child takes them.
  sigset_t none, all;
  sigemptyset(&none);
  sigfillset(&all);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &all);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  std::vector<std::string> arguments = command.arguments, environment = command.environment;
  const int error = posix_spawnp(&child, arguments[0].c_str(), &files, &attributes,
                                 pointers_to(arguments).data(), pointers_to(environment).data());
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  return error;
}

ChildEnd wait_for(pid_t child, const std::stop_token& stop) {
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
  if (WIFSIGNALED(status)) return {0, WTERMSIG(status)};
  return {WEXITSTATUS(status), 0};
}

}  // namespace

MemoryFile::MemoryFile(const char* name) : descriptor_(memfd_create(name, MFD_CLOEXEC)) {}

MemoryFile::~MemoryFile() {
  if (descriptor_ >= 0) close(descriptor_);
}

std::uint64_t MemoryFile::size_bytes() const {
  struct stat about {};
  return fstat(descriptor_, &about) == 0 ? std::uint64_t(about.st_size) : 0;
}

bool MemoryFile::write_all(std::initializer_list<std::string_view> pieces) const {
  for (const std::string_view piece : pieces) {
    for (std::size_t at = 0; at < piece.size();) {
      const ssize_t written = write(descriptor_, piece.data() + at, piece.size() - at);
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) return false;
      at += std::size_t(written);
    }
  }
  return lseek(descriptor_, 0, SEEK_SET) == 0;
}

std::vector<std::byte> MemoryFile::read_all() const {
  std::vector<std::byte> bytes(std::size_t{size_bytes()});
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t got = pread(descriptor_, bytes.data() + at, bytes.size() - at, off_t(at));
    if (got <= 0) return {};
    at += std::size_t(got);
  }
  return bytes;
}

MappedFile::MappedFile(int descriptor, std::size_t bytes) {
  if (bytes == 0) return;
  void* data = mmap(nullptr, bytes, PROT_READ, MAP_PRIVATE, descriptor, 0);
  if (data == MAP_FAILED) return;
  data_ = data;
  size_ = bytes;
}

MappedFile::~MappedFile() {
  if (data_ != nullptr) munmap(data_, size_);
}

Result<ChildEnd> run_child(const ChildCommand& command, const std::stop_token& stop) {
  pid_t child = 0;
  if (const int error = spawn(child, command); error != 0) {
    const bool missing = error == ENOENT || error == EACCES;
    return Error{missing ? ErrorCode::kNotFound : ErrorCode::kIo,
                 "starting " + command.arguments[0] + ": " + std::strerror(error), ""};
  }
  return wait_for(child, stop);
}

std::vector<std::string> environment_with(const std::string& setting) {
  const std::string name = setting.substr(0, setting.find('=') + 1);
  std::vector<std::string> list{setting};
  for (char** entry = environ; *entry != nullptr; ++entry)
    if (!std::string_view(*entry).starts_with(name)) list.emplace_back(*entry);
  return list;
}

}  // namespace gridcast::server
