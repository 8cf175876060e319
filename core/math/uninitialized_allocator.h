#pragma once

#include <cstddef>
#include <cstdlib>
#include <limits>
#include <new>
#include <utility>

namespace gridcast {

/// Memory for std::free that starts at a cache line, or from 4 MiB on at a huge page, and the system is asked
/// for such pages: rays jump about in a tree, and with small pages every jump would also miss the table of
/// translations. Throws std::bad_alloc.
[[nodiscard]] void* allocate_aligned(std::size_t bytes);

/// Where memory comes from: at a cache line or a huge page, for what is jumped about in; or from the heap,
/// which hands out again what was freed, for what is written and read once: a new huge page is cleared first.
struct AlignedMemory {
  [[nodiscard]] static void* allocate(std::size_t bytes) { return allocate_aligned(bytes); }
  static void free(void* memory) { std::free(memory); }
};
struct HeapMemory {
  [[nodiscard]] static void* allocate(std::size_t bytes) { return ::operator new(bytes); }
  static void free(void* memory) { ::operator delete(memory); }
};

/// resize() leaves new elements uninitialised: the threads that fill them touch the memory first, and once.
template <class T, class Memory = AlignedMemory>
class UninitializedAllocator {
 public:
  using value_type = T;

  UninitializedAllocator() = default;
  template <class U>
  // NOLINTNEXTLINE(google-explicit-constructor): allocators convert
  UninitializedAllocator(const UninitializedAllocator<U, Memory>& /*other*/) {}

  [[nodiscard]] T* allocate(std::size_t count) {
    if (count > std::numeric_limits<std::ptrdiff_t>::max() / sizeof(T)) throw std::bad_array_new_length();
    return static_cast<T*>(Memory::allocate(count * sizeof(T)));
  }
  void deallocate(T* memory, std::size_t /*count*/) { Memory::free(memory); }

  template <class U>
  void construct(U* place) {
    ::new (static_cast<void*>(place)) U;
  }
  template <class U, class... Arguments>
  void construct(U* place, Arguments&&... arguments) {
    ::new (static_cast<void*>(place)) U(std::forward<Arguments>(arguments)...);
  }

  template <class U>
  friend bool operator==(const UninitializedAllocator& /*a*/,
                         const UninitializedAllocator<U, Memory>& /*b*/) {
    return true;
  }
};

}  // namespace gridcast
