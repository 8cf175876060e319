#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>

namespace gridcast::server {

/// What the process may hold in memory. Near the budget new work is refused, so that the system never has to
/// end the process. Any thread may call.
class MemoryBudget {
 public:
  /// 0: no budget, always kFree.
  explicit MemoryBudget(std::uint64_t bytes);
  ~MemoryBudget();
  MemoryBudget(const MemoryBudget&) = delete;
  MemoryBudget& operator=(const MemoryBudget&) = delete;

  enum class Level : std::uint8_t {
    kFree,
    kTight,  ///< at 85 %: nothing that takes much, or stays
    kFull,   ///< at 95 %: nothing but looking, and deleting
  };
  /// Where the process would be with `more` bytes on top of what it holds.
  [[nodiscard]] Level level(std::uint64_t more = 0) const;

  /// `relief` gives up what is kept in hope of use alone. It is run by level(), before that tells, where the
  /// process would be at 70 % or more: so what it gives up never has a request refused. Any thread may run
  /// it. Set before others call.
  void set_relief(std::function<void()> relief) { relief_ = std::move(relief); }

  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  /// Resident now, by /proc/self/statm (proc(5)): what the kernel counts against a container's limit.
  [[nodiscard]] std::uint64_t used() const;

  /// A request below this is never too much for kTight.
  static constexpr std::size_t kSmallBytes = std::size_t(64) << 10;

 private:
  [[nodiscard]] double share_with(std::uint64_t more) const;

  const std::uint64_t bytes_;
  std::function<void()> relief_;
  const int statm_;
};

/// The least of the machine's memory and the limits of the control groups that the process is in (version 2's
/// memory.max; version 1's memory.limit_in_bytes of a container).
[[nodiscard]] std::uint64_t available_memory_bytes();

}  // namespace gridcast::server
