#include "server/memory_budget.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <limits>
#include <string>

#include <fcntl.h>
#include <unistd.h>

namespace gridcast::server {
namespace {

constexpr double kReliefShare = 0.70;
constexpr double kTightShare = 0.85;
constexpr double kFullShare = 0.95;
constexpr std::uint64_t kNoLimit = std::numeric_limits<std::uint64_t>::max();

/// The number that a file begins with; no limit where there is none ("max").
std::uint64_t number_in(const std::string& path) {
  std::ifstream file(path);
  std::uint64_t number = 0;
  return file >> number ? number : kNoLimit;
}

/// The limit of the group at `path` and of all above it.
std::uint64_t group_limit(std::string path) {
  std::uint64_t limit = kNoLimit;
  while (true) {
    limit = std::min(limit, number_in("/sys/fs/cgroup" + path + "/memory.max"));
    if (path.empty()) return limit;
    path.resize(path.rfind('/'));
  }
}

std::uint64_t control_group_limit() {
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);)
    if (line.starts_with("0::/")) return group_limit(line == "0::/" ? std::string() : line.substr(3));
  return number_in("/sys/fs/cgroup/memory/memory.limit_in_bytes");
}

std::uint64_t page_bytes() {
  static const auto bytes = std::uint64_t(::sysconf(_SC_PAGESIZE));
  return bytes;
}

}  // namespace

MemoryBudget::MemoryBudget(std::uint64_t bytes)
    : bytes_(bytes), statm_(::open("/proc/self/statm", O_RDONLY | O_CLOEXEC)) {}

MemoryBudget::~MemoryBudget() {
  if (statm_ >= 0) ::close(statm_);
}

MemoryBudget::Level MemoryBudget::level(std::uint64_t more) const {
  if (bytes_ == 0) return Level::kFree;
  double share = share_with(more);
  if (share >= kReliefShare && relief_) {
    relief_();
    share = share_with(more);
  }
  if (share >= kFullShare) return Level::kFull;
  return share >= kTightShare ? Level::kTight : Level::kFree;
}

double MemoryBudget::share_with(std::uint64_t more) const {
  return (double(used()) + double(more)) / double(bytes_);
}

std::uint64_t MemoryBudget::used() const {
  std::array<char, 128> text{};
  const ssize_t n = ::pread(statm_, text.data(), text.size(), 0);
  const char* const end = text.data() + std::max<ssize_t>(n, 0);
  const char* const second = std::find(static_cast<const char*>(text.data()), end, ' ');
  std::uint64_t pages = 0;
  if (second != end) std::from_chars(second + 1, end, pages);
  return pages * page_bytes();
}

std::uint64_t available_memory_bytes() {
  const std::uint64_t machine = std::uint64_t(::sysconf(_SC_PHYS_PAGES)) * page_bytes();
  return std::min(machine, control_group_limit());
}

}  // namespace gridcast::server
