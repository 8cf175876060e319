#include "core/math/memory_pool.h"

#include <new>

namespace gridcast {
namespace {

// What is kept is not freed, so that AddressSanitizer would not see who still uses it.
#if defined(__SANITIZE_ADDRESS__)
constexpr std::size_t kMost = 0;
#else
constexpr std::size_t kMost = MemoryPool::kKeptBytes;
#endif

}  // namespace

MemoryPool::~MemoryPool() {
  for (void* memory : kept_) ::operator delete(memory);
}

void* MemoryPool::take() {
  {
    const std::lock_guard lock(mutex_);
    if (!kept_.empty()) {
      void* const memory = kept_.back();
      kept_.pop_back();
      return memory;
    }
    // So that to give back takes no memory, which might not be there.
    if (kept_.capacity() == 0) kept_.reserve(kMost / bytes_);
  }
  return ::operator new(bytes_);
}

void MemoryPool::give_back(void* memory) noexcept {
  {
    const std::lock_guard lock(mutex_);
    if (kept_.size() < kept_.capacity() && (kept_.size() + 1) * bytes_ <= kMost) {
      kept_.push_back(memory);
      return;
    }
  }
  ::operator delete(memory);
}

std::size_t MemoryPool::kept_bytes() const {
  const std::lock_guard lock(mutex_);
  return kept_.size() * bytes_;
}

}  // namespace gridcast
