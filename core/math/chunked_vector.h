#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/math/memory_pool.h"

namespace gridcast {

/// A vector in shared chunks: a copy shares every chunk, writing to one element copies its chunk alone.
/// Reading is safe from any thread. Writing needs that no other thread uses this copy, and that the vector
/// it was copied from lives until the writing is done (so a chunk seen to have one owner was made here).
template <class T, std::size_t kChunk = 256>
class ChunkedVector {
 public:
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] const T& operator[](std::size_t i) const { return (*chunks_[i / kChunk])[i % kChunk]; }

  /// A reference to write through; copies the chunk when another vector shares it. Different chunks may be
  /// written from different threads, and different elements of one that is this vector's own.
  [[nodiscard]] T& write(std::size_t i) { return write_chunk(i)[i % kChunk]; }
  /// All elements of the chunk of element i, to write through.
  [[nodiscard]] std::span<T, kChunk> write_chunk(std::size_t i) {
    std::shared_ptr<Chunk>& chunk = chunks_[i / kChunk];
    if (chunk.use_count() != 1) chunk = std::make_shared<Chunk>(*chunk);
    return *chunk;
  }
  /// The same, for all of them to be written: what they are until then means nothing, since nothing is copied
  /// when another vector shares the chunk.
  [[nodiscard]] std::span<T, kChunk> overwrite_chunk(std::size_t i) requires std::is_trivially_copyable_v<T> {
    std::shared_ptr<Chunk>& chunk = chunks_[i / kChunk];
    if (chunk.use_count() != 1) chunk = std::allocate_shared<Chunk>(UnwrittenAllocator<Chunk>());
    return *chunk;
  }
  /// All elements of the chunk of element i; the last chunk may have more than size() tells.
  [[nodiscard]] std::span<const T, kChunk> chunk(std::size_t i) const { return *chunks_[i / kChunk]; }
  void push_back(T value) {
    if (size_ % kChunk == 0) chunks_.push_back(std::make_shared<Chunk>());
    ++size_;
    write(size_ - 1) = std::move(value);
  }
  /// Grows to `size` default elements; never shrinks.
  void grow(std::size_t size) {
    while (chunks_.size() * kChunk < size) chunks_.push_back(std::make_shared<Chunk>());
    size_ = std::max(size_, size);
  }
  /// Whether both hold element i in the very same chunk: then all of that chunk is the same.
  [[nodiscard]] bool shares_chunk(const ChunkedVector& other, std::size_t i) const {
    const std::size_t chunk = i / kChunk;
    return chunk < other.chunks_.size() && chunks_[chunk] == other.chunks_[chunk];
  }
  [[nodiscard]] std::size_t memory_bytes() const {
    return chunks_.capacity() * sizeof(chunks_[0]) + chunks_.size() * sizeof(Chunk);
  }
  static constexpr std::size_t kChunkSize = kChunk;

 private:
  using Chunk = std::array<T, kChunk>;

  /// Leaves memory as it is: a chunk of what can be copied byte by byte needs no constructor to begin. Of a
  /// pool that all of the type share, and that is never destroyed, since chunks may outlive whatever is.
  template <class U>
  struct UnwrittenAllocator {
    using value_type = U;
    static_assert(alignof(U) <= alignof(std::max_align_t));
    UnwrittenAllocator() = default;
    template <class V>
    explicit UnwrittenAllocator(const UnwrittenAllocator<V>& /*other*/) {}
    [[nodiscard]] U* allocate(std::size_t /*one*/) { return static_cast<U*>(pool().take()); }
    void deallocate(U* memory, std::size_t /*one*/) { pool().give_back(memory); }
    void construct(Chunk* /*place*/) {}
    static MemoryPool& pool() {
      static auto* const pool = new MemoryPool(sizeof(U));
      return *pool;
    }
  };

  std::vector<std::shared_ptr<Chunk>> chunks_;
  std::size_t size_ = 0;
};

}  // namespace gridcast
