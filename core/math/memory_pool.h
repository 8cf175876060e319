#pragma once

#include <cstddef>
#include <mutex>
#include <vector>

namespace gridcast {

/// Memory of one size that comes and goes in great numbers: some of what is given back is kept for whoever is
/// next, without a look at it. (malloc looks at each piece and at its neighbours, which are in no cache by
/// then: of what it took to move all of 10,000 instances that was an eighth.) Any thread may take and give.
class MemoryPool {
 public:
  /// Keeps at most this much.
  static constexpr std::size_t kKeptBytes = std::size_t(8) << 20;

  explicit MemoryPool(std::size_t bytes) : bytes_(bytes) {}
  MemoryPool(const MemoryPool&) = delete;
  MemoryPool& operator=(const MemoryPool&) = delete;
  ~MemoryPool();

  /// For any type whose alignment is not above that of malloc. Throws std::bad_alloc.
  [[nodiscard]] void* take();
  void give_back(void* memory) noexcept;
  [[nodiscard]] std::size_t kept_bytes() const;

 private:
  const std::size_t bytes_;
  mutable std::mutex mutex_;
  std::vector<void*> kept_;
};

}  // namespace gridcast
