#pragma once

#include <cstddef>
#include <cstdint>

#include "core/math/affine.h"
#include "core/math/chunked_vector.h"
#include "core/math/instance_mask.h"
#include "core/math/ray.h"

namespace gridcast::scene {

/// What of an instance stays when it moves.
struct InstanceSlot {
  std::uint32_t mesh_id = kInvalidId;
  bool alive = true;
  InstanceMask mask = kFullMask;  ///< 0: no query sees it
};

/// A slot and where its instance is: a view that is valid as long as the table it is from is not written.
struct Instance {
  const InstanceTransform& transform;
  std::uint32_t mesh_id;
  bool alive;
  InstanceMask mask;

  [[nodiscard]] bool seen_by(InstanceMask query) const { return (mask & query) != 0; }
};

/// The slots of a scene by instance_id, and apart from them where each is, so that whoever moves all neither
/// reads nor writes what stays. A value: copies share chunks, see ChunkedVector.
class InstanceTable {
 public:
  /// Chunks are small, since an instance that moves costs a copy of its chunk.
  using Transforms = ChunkedVector<InstanceTransform, 32>;
  using Slots = ChunkedVector<InstanceSlot, 256>;
  static constexpr std::size_t kBytesPerInstance = sizeof(InstanceTransform) + sizeof(InstanceSlot);

  [[nodiscard]] std::size_t size() const { return slots_.size(); }
  [[nodiscard]] Instance operator[](std::uint32_t id) const {
    const InstanceSlot& slot = slots_[id];
    return {transforms_[id], slot.mesh_id, slot.alive, slot.mask};
  }
  [[nodiscard]] const InstanceSlot& slot(std::uint32_t id) const { return slots_[id]; }
  /// Asks for the memory of what a ray needs of an instance. Inlined early, since GCC takes a function that
  /// only asks for memory to do nothing and leaves it out.
  [[gnu::always_inline]] void prefetch(std::uint32_t id) const {
    const InstanceTransform& transform = transforms_[id];
    __builtin_prefetch(&transform.world_from_object().translation);
    const Mat3d& linear = transform.object_from_world_linear();
    __builtin_prefetch(&linear);
    __builtin_prefetch(&linear[2][2]);
    __builtin_prefetch(&slots_[id]);
  }
  [[nodiscard]] std::size_t memory_bytes() const {
    return slots_.memory_bytes() + transforms_.memory_bytes();
  }
  /// Whether both hold what tells of the instances from `first`, a multiple of kChunkSize, up to the next
  /// multiple in the very same memory.
  [[nodiscard]] bool shares_chunk(const InstanceTable& other, std::size_t first) const {
    return transforms_.shares_chunk(other.transforms_, first) && slots_.shares_chunk(other.slots_, first);
  }
  static constexpr std::size_t kChunkSize = Transforms::kChunkSize;

  void grow(std::size_t size) {
    slots_.grow(size);
    transforms_.grow(size);
  }
  void push_back(const InstanceTransform& transform, const InstanceSlot& slot) {
    slots_.push_back(slot);
    transforms_.push_back(transform);
  }
  [[nodiscard]] InstanceSlot& write_slot(std::uint32_t id) { return slots_.write(id); }
  [[nodiscard]] Transforms& transforms() { return transforms_; }

 private:
  Slots slots_;
  Transforms transforms_;
};

}  // namespace gridcast::scene
