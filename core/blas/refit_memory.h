#pragma once
// What the refits of one wide tree share: which vertices go where, and memory that goes round.

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/blas/wide_bvh.h"
#include "core/blas/wide_damage.h"
#include "core/blas/wide_parts.h"

namespace gridcast::blas {

/// The vertices and names of a block's triangles, one cache line: a refit reads these in order instead of
/// looking up every triangle.
struct alignas(64) BlockCorners {
  std::uint32_t vertices[3][4];  ///< [corner][lane]
  std::uint32_t ids[4];          ///< the last one with kLoadSingly where it applies

  /// One of the vertices is the mesh's last: 16 bytes cannot be read there.
  static constexpr std::uint32_t kLoadSingly = 1U << 31;
};
static_assert(sizeof(BlockCorners) == 64);

using BlockCornersList = std::vector<BlockCorners, UninitializedAllocator<BlockCorners>>;

/// Of the triangles that the block names.
[[nodiscard]] BlockCorners corners_of(const TriangleBlock& block, const mesh::TriangleMesh& mesh);

/// What a refit of the whole tree needs to know of its shape, and a repair of how good it was.
struct RefitPlan {
  RefitPlan() = default;
  /// Of a tree as it was built.
  RefitPlan(const WideBvh& built, const mesh::TriangleMesh& mesh);
  WideParts parts;
  BlockCornersList corners;              ///< one per block
  std::vector<PartLooseness> looseness;  ///< of each part when it was built
};

/// From a vertex to what must be drawn anew when it moves.
struct VertexLinks {
  VertexLinks(const WideNodes& nodes, const BlockCornersList& corners, std::size_t vertex_count);
  [[nodiscard]] std::span<const std::uint32_t> blocks_of(std::uint32_t vertex) const {
    return {blocks.data() + first_block[vertex], blocks.data() + first_block[vertex + 1]};
  }
  std::vector<std::uint32_t> first_block;    ///< by vertex: where its blocks start in `blocks`; one more
  std::vector<std::uint32_t> blocks;         ///< ascending for each vertex
  std::vector<std::uint32_t> node_of_block;  ///< that holds the leaf
  std::vector<std::uint32_t> parent;         ///< of each node; the root's is 0
};

/// Shared by a built tree and all of its refits. Thread-safe.
class RefitMemory {
 public:
  RefitMemory() = default;
  explicit RefitMemory(RefitPlan plan) : plan_(std::move(plan)) {}

  /// Made when first asked for: a mesh that never moves needs none.
  [[nodiscard]] const RefitPlan& plan(const WideBvh& tree, const mesh::TriangleMesh& mesh);
  [[nodiscard]] const VertexLinks& links(const WideBvh& tree, const mesh::TriangleMesh& mesh);

  /// How good each part was when it was built; empty while there is no plan, which would find the same.
  [[nodiscard]] std::vector<PartLooseness> planned_looseness() const;

  [[nodiscard]] std::uint64_t next_version();
  /// Of a version that nobody reads any more; empty when there is none.
  [[nodiscard]] WideStorage take();
  /// Keeps one storage of a deforming mesh for the next refit, so that refits that follow each other allocate
  /// nothing: the tree that is read and the one that is made next.
  void give_back(WideStorage storage);
  /// Of the plan, the links and what is kept.
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  const RefitPlan& plan_locked(const WideBvh& tree, const mesh::TriangleMesh& mesh);

  mutable std::mutex mutex_;
  std::optional<RefitPlan> plan_;
  std::optional<VertexLinks> links_;
  WideStorage spare_;
  std::uint64_t last_version_ = 0;
};

}  // namespace gridcast::blas
