#pragma once
// The production tree: eight children a node, triangles in blocks of four, SIMD on whatever the CPU has.

#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <vector>

#include "core/blas/blas.h"
#include "core/blas/bvh_node.h"
#include "core/blas/collector.h"
#include "core/blas/exact_packet.h"
#include "core/blas/point_sink.h"
#include "core/blas/tree_bytes.h"
#include "core/blas/triangle_block.h"
#include "core/math/uninitialized_allocator.h"

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

class RefitMemory;
struct RefitPlan;
struct WideRepair;
class Splice;

/// Two corners with room for four floats; the fourth are anything.
struct alignas(32) PaddedBox {
  float lower[4];
  float upper[4];
};

/// The memory of a tree. Refits of one tree have arrays of the same sizes, so it can go round among them.
struct WideStorage {
  WideNodes nodes;  ///< parents before children
  TriangleBlocks blocks;
  std::vector<double> part_costs;     ///< see wide_cost.h
  std::vector<PaddedBox> part_boxes;  ///< scratch of a refit
  std::uint64_t version = 0;          ///< 0 as built; refits count up
  static constexpr std::uint64_t kUnfinished = ~std::uint64_t(0);
};

class WideBvh {
 public:
  WideBvh() = default;
  WideBvh(const WideBvh&) = delete;
  WideBvh& operator=(const WideBvh&) = delete;
  ~WideBvh();

  /// Built from the binned-SAH binary tree and collapsed at the least surface-area cost, or in Morton order
  /// (wide_morton_builder.h). kCancelled on `stop`, kLimitExceeded for 2^30 - 1 triangles or more.
  [[nodiscard]] static Result<std::shared_ptr<const WideBvh>> build(const mesh::TriangleMesh& mesh,
                                                                    const BuildOptions& options,
                                                                    std::stop_token stop);
  /// The same tree over moved vertices; boxes are bit for bit those of a build with this shape. A leaf that
  /// had a part of a triangle gets the box of the whole: right, but worse.
  [[nodiscard]] Result<std::shared_ptr<const WideBvh>> refit(const mesh::TriangleMesh& moved) const;
  /// The same, bit for bit, when only these vertices differ from the mesh this tree is drawn around. A few of
  /// them cost what lies above them: O(k log n), when the version before this one is no longer read.
  [[nodiscard]] Result<std::shared_ptr<const WideBvh>> refit(const mesh::TriangleMesh& moved,
                                                             std::span<const std::uint32_t> vertices) const;

  /// Subtrees of a refitted tree that have become worse than the rest are built anew. kUnsupported when
  /// several leaves share a triangle; kCancelled on `stop`.
  [[nodiscard]] Result<WideRepair> repair(const mesh::TriangleMesh& mesh, const std::stop_token& stop) const;

  /// As Bvh::write and Bvh::read. Corners are not written: they are the mesh's.
  void write(TreeWriter& out) const;
  [[nodiscard]] static Result<std::shared_ptr<const WideBvh>> read(const mesh::TriangleMesh& mesh,
                                                                   TreeReader& in);

  /// True when an offer narrowed the range or ended the traversal.
  template <Precision kPrecision, Collector C>
  bool intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const;

  /// Offers the triangles around sink.center(); see PointSink.
  void search(const mesh::TriangleMesh& mesh, PointSink& sink) const;

  /// The same for a packet: best[lane] as `intersect` would leave it, lane by lane; not used for any hit.
  /// `bounds` are the mesh's.
  template <Precision kPrecision, bool kAnyHit>
  PacketResult intersect_packet(const Bounds3f& bounds, const PacketOf<kPrecision>& packet,
                                BestOf<kPrecision>* best) const;

  [[nodiscard]] Status validate(const mesh::TriangleMesh& mesh) const;
  void add_stats(StructureStats& stats) const;

  /// Whether leaves contain their triangles whole, so that root_bounds() is the box of the mesh.
  [[nodiscard]] bool has_whole_triangles() const { return shape_.spatial == SpatialSplits::kNever; }
  /// What the root's boxes contain; after a refit the box of the mesh.
  [[nodiscard]] Bounds3f root_bounds() const {
    Bounds3f box;
    if (nodes().empty()) return box;
    for (std::uint32_t slot = 0; slot < nodes()[0].slots; ++slot) box.extend(nodes()[0].box(slot));
    return box;
  }

  [[nodiscard]] const WideNodes& nodes() const { return storage_.nodes; }
  [[nodiscard]] const TriangleBlocks& blocks() const { return storage_.blocks; }
  [[nodiscard]] std::span<const double> part_costs() const { return storage_.part_costs; }

 private:
  /// What a refit leaves as it is.
  struct Shape {
    std::size_t reference_count = 0;
    std::size_t leaf_count = 0;
    std::size_t max_depth = 0;
    SpatialSplits spatial = SpatialSplits::kNever;  ///< whether several leaves may hold a triangle
  };
  void measure_shape();
  /// A tree of this shape to be drawn into `storage`, which may be empty.
  [[nodiscard]] std::shared_ptr<WideBvh> unfinished_copy(WideStorage storage) const;

  /// Adds the blocks in which `storage` differs from this tree; false when that is not known.
  [[nodiscard]] bool add_missed(const WideStorage& storage, std::vector<std::uint32_t>& blocks) const;

  /// A version and the blocks that were drawn anew after it.
  struct PatchedFrom {
    std::uint64_t version;
    std::shared_ptr<const std::vector<std::uint32_t>> blocks;
  };

  WideStorage storage_;
  std::vector<PatchedFrom> history_;  ///< latest first; empty after a refit of everything
  Shape shape_;
  std::shared_ptr<RefitMemory> memory_;  ///< shared with all refits of the same build
};

}  // namespace gridcast::blas
