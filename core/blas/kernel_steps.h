#pragma once
// Single steps of the traversal kernels, with the instructions that the kernels use now: for walks that
// explain them and must come to the same decisions. Defined beside the kernels; the kernels do not call them.

#include <cstdint>

#include "core/blas/compact_node.h"
#include "core/blas/kd_tree.h"
#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

/// The bits of s_enter, a float that is not negative, of each slot of a node.
struct alignas(32) SlotEntries {
  std::int32_t s_enter_bits[8];
};

/// Slab test of a node's slots; returns a bit per slot that may be hit.
[[nodiscard]] std::uint32_t enter_node(const WideNode& node, const mesh::ObjectRay& ray, float s_far,
                                       SlotEntries& entries);
[[nodiscard]] std::uint32_t enter_node(const CompactNode& node, const mesh::ObjectRay& ray, float s_far,
                                       SlotEntries& entries);

/// A bit per triangle of the block that may be hit up to s_far; the others are not.
template <Precision kPrecision>
[[nodiscard]] std::uint32_t filter_triangles(const TriangleBlock& block, const mesh::ObjectRay& ray,
                                             float s_far);

/// The ray's [enter, exit] in each slot of a treelet.
struct alignas(32) SlotSegments {
  float enter[8], exit[8];
};

/// The ray's interval in a kd-tree's box; `exit` is given as s_far. False when it is missed.
[[nodiscard]] bool enter_kd_root(const mesh::ObjectRay& ray, const Bounds3f& box, float& enter, float& exit);

/// The ray's intervals in the slots of a treelet that it passes in [s_enter, s_exit]; returns a bit per slot.
[[nodiscard]] std::uint32_t enter_treelet(const KdTreelet& treelet, const mesh::ObjectRay& ray, float s_enter,
                                          float s_exit, SlotSegments& segments);

}  // namespace gridcast::blas
