#pragma once
// The production tree: eight children a node, triangles in blocks of four, SIMD on whatever the CPU has.

#include <cstdint>
#include <memory>
#include <stop_token>
#include <vector>

#include "core/blas/blas.h"
#include "core/blas/bvh_node.h"
#include "core/blas/collector.h"
#include "core/blas/point_sink.h"
#include "core/blas/ray_packet.h"
#include "core/blas/triangle_block.h"
#include "core/blas/uninitialized_allocator.h"

namespace gridcast::blas {

/// 256 bytes, four cache lines. An unused slot has an inverted box, which no ray enters.
struct alignas(64) WideNode {
  float planes[2][3][8];   ///< [lower, upper][axis][slot]
  std::uint32_t child[8];  ///< see WideChild
  std::uint32_t slots;     ///< used slots, from 0
  std::uint32_t unused[7];

  [[nodiscard]] Bounds3f box(std::uint32_t slot) const {
    return {{planes[0][0][slot], planes[0][1][slot], planes[0][2][slot]},
            {planes[1][0][slot], planes[1][1][slot], planes[1][2][slot]}};
  }
  void set_box(std::uint32_t slot, const Bounds3f& box) {
    for (int axis = 0; axis < 3; ++axis) {
      planes[0][axis][slot] = box.lower[axis];
      planes[1][axis][slot] = box.upper[axis];
    }
  }
};
static_assert(sizeof(WideNode) == 256);

/// A child link: an inner node's index, or a leaf of one or two consecutive blocks.
namespace wide_child {
inline constexpr std::uint32_t kLeafBit = 1U << 31;
inline constexpr std::uint32_t kTwoBlocksBit = 1U << 30;
inline constexpr std::uint32_t kIndexMask = kTwoBlocksBit - 1;
inline bool is_leaf(std::uint32_t link) {
  return (link & kLeafBit) != 0;
}
inline std::uint32_t index(std::uint32_t link) {
  return link & kIndexMask;
}
inline std::uint32_t block_count(std::uint32_t link) {
  return (link & kTwoBlocksBit) != 0 ? 2U : 1U;
}
inline std::uint32_t leaf(std::uint32_t first_block, std::uint32_t blocks) {
  return kLeafBit | (blocks == 2 ? kTwoBlocksBit : 0U) | first_block;
}
}  // namespace wide_child

using WideNodes = std::vector<WideNode, UninitializedAllocator<WideNode>>;

/// Leaves hold at most two blocks.
inline constexpr std::size_t kMaxWideLeaf = 8;
/// A node on the way down leaves at most seven entries behind.
inline constexpr std::size_t kWideStackSize = 7 * kMaxBvhDepth + 8;

class WideBvh {
 public:
  /// Built from the binned-SAH binary tree and collapsed at the least surface-area cost. kCancelled on
  /// `stop`, kLimitExceeded for 2^30 - 1 triangles or more.
  [[nodiscard]] static Result<std::shared_ptr<const WideBvh>> build(const mesh::TriangleMesh& mesh,
                                                                    const BuildOptions& options,
                                                                    std::stop_token stop);
  /// The same tree over moved vertices; boxes are bit for bit those of a build with this shape. A leaf that
  /// had a part of a triangle gets the box of the whole: right, but worse.
  [[nodiscard]] Result<std::shared_ptr<const WideBvh>> refit(const mesh::TriangleMesh& moved) const;

  /// True when an offer narrowed the range or ended the traversal.
  template <Precision kPrecision, Collector C>
  bool intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const;

  /// Offers the triangles around sink.center(); see PointSink.
  void search(const mesh::TriangleMesh& mesh, PointSink& sink) const;

  /// The same for a packet: best[lane] as `intersect` would leave it, lane by lane. `bounds` are the mesh's.
  template <Precision kPrecision, bool kAnyHit>
  PacketResult intersect_packet(const Bounds3f& bounds, const RayPacket& packet, Hit* best) const;

  [[nodiscard]] Status validate(const mesh::TriangleMesh& mesh) const;
  void add_stats(StructureStats& stats) const;

  /// What the root's boxes contain; after a refit the box of the mesh.
  [[nodiscard]] Bounds3f root_bounds() const {
    Bounds3f box;
    if (nodes_.empty()) return box;
    for (std::uint32_t slot = 0; slot < nodes_[0].slots; ++slot) box.extend(nodes_[0].box(slot));
    return box;
  }

  [[nodiscard]] const WideNodes& nodes() const { return nodes_; }
  [[nodiscard]] const TriangleBlocks& blocks() const { return blocks_; }

 private:
  WideNodes nodes_;  ///< parents before children
  TriangleBlocks blocks_;
  std::size_t reference_count_ = 0;
  SpatialSplits spatial_ = SpatialSplits::kNever;  ///< whether several leaves may hold a triangle
};

}  // namespace gridcast::blas
