#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <limits>
#include <new>
#include <utility>

namespace gridcast::blas {

/// resize() leaves new elements uninitialised: the threads that fill them touch the memory first, and once.
/// Memory starts at a cache line; from kHugeBytes on at a huge page, and the system is asked for such pages:
/// rays jump about in a tree, and with small pages every jump would also miss the table of translations.
template <class T>
class UninitializedAllocator {
 public:
  using value_type = T;
  static constexpr std::size_t kHugePage = std::size_t(1) << 21;
  static constexpr std::size_t kHugeBytes = 2 * kHugePage;

  UninitializedAllocator() = default;
  template <class U>
  // NOLINTNEXTLINE(google-explicit-constructor): allocators convert
  UninitializedAllocator(const UninitializedAllocator<U>& /*other*/) {}

  [[nodiscard]] T* allocate(std::size_t count) {
    if (count > (std::numeric_limits<std::size_t>::max() - kHugePage) / sizeof(T))
      throw std::bad_array_new_length();
    const std::size_t unit = count * sizeof(T) >= kHugeBytes ? kHugePage : kCacheLine;
    const std::size_t bytes = (count * sizeof(T) + unit - 1) / unit * unit;
    void* memory = std::aligned_alloc(unit, bytes);
    if (memory == nullptr) throw std::bad_alloc();
    // Without huge pages everything works, only slower.
    if (unit == kHugePage) (void)madvise(memory, bytes, MADV_HUGEPAGE);
    return static_cast<T*>(memory);
  }
  void deallocate(T* memory, std::size_t /*count*/) { std::free(memory); }

  template <class U>
  void construct(U* place) {
    ::new (static_cast<void*>(place)) U;
  }
  template <class U, class... Arguments>
  void construct(U* place, Arguments&&... arguments) {
    ::new (static_cast<void*>(place)) U(std::forward<Arguments>(arguments)...);
  }

  template <class U>
  friend bool operator==(const UninitializedAllocator& /*a*/, const UninitializedAllocator<U>& /*b*/) {
    return true;
  }

 private:
  static constexpr std::size_t kCacheLine = 64;
};

}  // namespace gridcast::blas
