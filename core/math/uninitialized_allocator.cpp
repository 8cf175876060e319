#include "core/math/uninitialized_allocator.h"

#include <sys/mman.h>

namespace gridcast {

void* allocate_aligned(std::size_t bytes) {
  constexpr std::size_t kCacheLine = 64, kHugePage = std::size_t(1) << 21;
  const std::size_t unit = bytes >= 2 * kHugePage ? kHugePage : kCacheLine;
  const std::size_t whole = (bytes + unit - 1) / unit * unit;
  void* memory = std::aligned_alloc(unit, whole);
  if (memory == nullptr) throw std::bad_alloc();
  // Without huge pages everything works, only slower.
  if (unit == kHugePage) (void)madvise(memory, whole, MADV_HUGEPAGE);
  return memory;
}

}  // namespace gridcast
