#pragma once

#include <new>
#include <utility>

#include <oneapi/tbb/cache_aligned_allocator.h>

namespace gridcast::blas {

/// resize() leaves new elements uninitialised: the threads that fill them touch the memory first, and once.
template <class T>
class UninitializedAllocator : public oneapi::tbb::cache_aligned_allocator<T> {
 public:
  using value_type = T;
  template <class U>
  struct rebind {  // NOLINT(readability-identifier-naming): the standard's name
    using other = UninitializedAllocator<U>;
  };
  UninitializedAllocator() = default;
  template <class U>
  // NOLINTNEXTLINE(google-explicit-constructor): allocators convert
  UninitializedAllocator(const UninitializedAllocator<U>& /*other*/) {}

  template <class U>
  void construct(U* place) {
    ::new (static_cast<void*>(place)) U;
  }
  template <class U, class... Arguments>
  void construct(U* place, Arguments&&... arguments) {
    ::new (static_cast<void*>(place)) U(std::forward<Arguments>(arguments)...);
  }
};

}  // namespace gridcast::blas
