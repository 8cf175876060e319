// The import helper itself: first it gives up whatever it will not need.

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <fstream>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "server/child_process.h"
#include "server/import/import_helper.h"
#include "server/import/import_order.h"

namespace gridcast::server {
namespace {

constexpr int kDone = 0;
constexpr int kNoOrder = 3;

// Sanitizers reserve terabytes of addresses and make calls of their own.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kConfine = false;
#else
constexpr bool kConfine = true;
#endif

/// Address space in use, by /proc/self/statm.
std::uint64_t used_bytes() {
  std::uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * std::uint64_t(::sysconf(_SC_PAGESIZE));
}

bool limit(int resource, std::uint64_t most, std::uint64_t beyond = 0) {
  const rlimit bound{rlim_t(most), rlim_t(most + beyond)};
  return ::setrlimit(__rlimit_resource_t(resource), &bound) == 0;
}

bool set_limits(const ImportOrder& order) {
  const std::uint64_t used = used_bytes();  // while a file can still be opened
  const std::uint64_t most = std::numeric_limits<std::int64_t>::max();
  const std::uint64_t addresses = order.memory_bytes > most - used ? most : used + order.memory_bytes;
  return limit(RLIMIT_CORE, 0) && limit(RLIMIT_NOFILE, 3) && limit(RLIMIT_NPROC, 0) &&
         limit(RLIMIT_CPU, std::max<std::uint64_t>(1, order.cpu_s), 1) &&
         limit(RLIMIT_FSIZE, order.output_bytes) && (!kConfine || limit(RLIMIT_AS, addresses));
}

#if defined(__x86_64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t kArchitecture = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t kArchitecture = 0;
#endif

/// What memory, locks, signals to itself, reading and writing of what is open, and an end take. Nothing that
/// opens, connects, starts or reaches another process.
constexpr std::array kAllowedCalls{
    SYS_read,
    SYS_pread64,
    SYS_write,
    SYS_writev,
    SYS_lseek,
    SYS_fstat,
    SYS_close,
    SYS_mmap,
    SYS_munmap,
    SYS_mremap,
    SYS_mprotect,
    SYS_madvise,
    SYS_brk,
    SYS_futex,
    SYS_rt_sigaction,
    SYS_rt_sigprocmask,
    SYS_rt_sigreturn,
    SYS_getpid,
    SYS_gettid,
    SYS_clock_gettime,
    SYS_getrandom,
    SYS_sched_yield,
    SYS_sched_getaffinity,
    SYS_exit,
    SYS_exit_group,
    SYS_restart_syscall,
};

sock_filter load(std::size_t offset) {
  return BPF_STMT(BPF_LD | BPF_W | BPF_ABS, std::uint32_t(offset));
}
sock_filter answer(std::uint32_t action) {
  return BPF_STMT(BPF_RET | BPF_K, action);
}
/// Goes on with the next instruction when equal, else skips it.
sock_filter unless_equal_skip(std::uint32_t value) {
  return BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, 1);
}

/// Every other call fails with EPERM.
bool confine_calls() {
  if (kArchitecture == 0 || !kConfine) return true;
  std::vector<sock_filter> program{load(offsetof(seccomp_data, arch)),
                                   BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, kArchitecture, 1, 0),
                                   answer(SECCOMP_RET_KILL_PROCESS), load(offsetof(seccomp_data, nr))};
  for (const long call : kAllowedCalls) {
    program.push_back(unless_equal_skip(std::uint32_t(call)));
    program.push_back(answer(SECCOMP_RET_ALLOW));
  }
  program.push_back(answer(SECCOMP_RET_ERRNO | (EPERM & SECCOMP_RET_DATA)));
  const sock_fprog filter{static_cast<unsigned short>(program.size()), program.data()};
  // EINVAL: a kernel that has no filters.
  return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0 || errno == EINVAL;
}

/// It ends with the thread that waits for it, and gets no rights that it has not.
bool bind_to(std::uint64_t parent) {
  return ::prctl(PR_SET_PDEATHSIG, SIGKILL) == 0 && std::uint64_t(::getppid()) == parent &&
         ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 && ::prctl(PR_SET_DUMPABLE, 0, 0, 0, 0) == 0;
}

bool write_all(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(STDOUT_FILENO, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes.remove_prefix(std::size_t(n));
  }
  return true;
}

int answer_order() {
  struct stat about {};
  if (::fstat(STDIN_FILENO, &about) != 0) return kNoOrder;
  const MappedFile input(STDIN_FILENO, std::size_t(about.st_size));
  const auto order = decode_import(input.text());
  if (!order || !bind_to(order->order.parent) || !set_limits(order->order) || !confine_calls())
    return kNoOrder;
  ::signal(SIGXFSZ, SIG_IGN);  // an answer that is too long is an error of write()
  const auto outcome = io::import_gltf(std::as_bytes(std::span(order->model.data(), order->model.size())),
                                       order->order.options);
  for (const std::string& piece : encode_outcome(outcome))
    if (!write_all(piece)) return kNoRoomExit;
  return kDone;
}

}  // namespace

void run_import_helper() {
  int code = kNoRoomExit;
  try {
    code = answer_order();
  } catch (const std::bad_alloc&) {
    // Said by the code.
  }
  ::_exit(code);
}

}  // namespace gridcast::server
