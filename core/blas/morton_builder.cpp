#include "core/blas/morton_builder.h"

#include <algorithm>
#include <memory>
#include <utility>

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/parallel_invoke.h>

#include "core/blas/bvh_subtree.h"
#include "core/blas/morton_ranges.h"

namespace gridcast::blas {
namespace {

/// One block of the wide tree.
constexpr std::size_t kLeafTriangles = 4;
/// Subtrees up to here follow the codes, what is above follows the cost.
constexpr std::uint32_t kClusterTriangles = 64;
/// Triangles that one task reads.
constexpr std::size_t kPieceTriangles = 4096;
/// Over this many clusters one thread builds: some tens of microseconds.
constexpr std::size_t kTaskClusters = 256;
/// Divisions by cost above the clusters; then halves, so that clusters begin above kMaxFreeDepth.
constexpr std::size_t kMaxClusterFreeDepth = kMaxFreeDepth - 32;

/// Clusters to become a node: [begin, end) of one of two arrays.
struct ClusterRange {
  std::size_t begin, end;
  std::uint32_t array;
  std::size_t depth;
  SetBounds bounds;
  [[nodiscard]] std::size_t size() const { return end - begin; }
};

MortonKeys order_of(std::span<const BuildReference> references, const Box4& bounds) {
  Centers centers(references.size());
  oneapi::tbb::parallel_for(std::size_t(0), (centers.size() + kPieceTriangles - 1) / kPieceTriangles,
                            [&](std::size_t piece) {
                              const std::size_t end = std::min(centers.size(), (piece + 1) * kPieceTriangles);
                              for (std::size_t i = piece * kPieceTriangles; i < end; ++i)
                                centers[i] = doubled_center(references[i].box());
                            });
  return morton_order(centers, bounds);
}

class MortonBuilder {
 public:
  MortonBuilder(const mesh::TriangleMesh& mesh, std::stop_token stop) : stop_(std::move(stop)) {
    const std::size_t count = mesh.triangle_count();
    auto references = std::make_unique_for_overwrite<BuildReference[]>(count);
    bounds_ = make_references(mesh, references.get());
    areas_ = AreaScale(bounds_.boxes.bounds());
    keys_ = order_of({references.get(), count}, bounds_.centers);
    sorted_ = std::make_unique_for_overwrite<BuildReference[]>(count);
    oneapi::tbb::parallel_for(std::size_t(0), (count + kPieceTriangles - 1) / kPieceTriangles,
                              [&](std::size_t piece) {
                                const std::size_t end = std::min(count, (piece + 1) * kPieceTriangles);
                                for (std::size_t i = piece * kPieceTriangles; i < end; ++i)
                                  sorted_[i] = references[morton_number(keys_[i])];
                              });
  }

  std::unique_ptr<Subtree> run() {
    make_clusters();
    return build({0, clusters_.size(), 0, 0, cluster_bounds_});
  }

 private:
  [[nodiscard]] std::unique_ptr<Subtree> build(const ClusterRange& range) const {
    auto subtree = std::make_unique<Subtree>();
    if (stop_.stop_requested()) return subtree;
    if (range.size() <= kTaskClusters) {
      subtree->nodes.reserve(range.size() * kClusterTriangles / 2);
      subtree->ids.reserve(range.size() * kClusterTriangles / 2);
      subtree->root = build_inline(range, *subtree);
      subtree->count_own();
      return subtree;
    }
    const auto halves = divide(range);
    oneapi::tbb::parallel_invoke([&] { subtree->children[0] = build(halves[0]); },
                                 [&] { subtree->children[1] = build(halves[1]); });
    set_box(subtree->root, range.bounds.boxes);
    subtree->count_children();
    return subtree;
  }

  /// `nodes` may move, so a child is written when it is complete.
  BvhNode build_inline(const ClusterRange& range, Subtree& subtree) const {
    if (range.size() == 1) {
      const KeyRange keys = clusters_[arrays_[range.array][range.begin].id];
      return build_cluster(keys, range.depth, subtree).first;
    }
    const auto halves = divide(range);
    const std::size_t pair = subtree.nodes.size();
    subtree.nodes.resize(pair + 2);
    for (std::size_t side = 0; side < 2; ++side) {
      const BvhNode child = build_inline(halves[side], subtree);
      subtree.nodes[pair + side] = child;
    }
    BvhNode node{};
    set_box(node, range.bounds.boxes);
    node.first = std::uint32_t(pair);
    return node;
  }

  [[nodiscard]] std::array<ClusterRange, 2> divide(const ClusterRange& range) const {
    BuildReference* const from = arrays_[range.array].get();
    BuildReference* const to = arrays_[1 - range.array].get();
    const std::span<BuildReference> references(from + range.begin, range.size());
    if (range.depth < kMaxClusterFreeDepth) {
      if (const auto split = find_binned_split(references, range.bounds, areas_, LeafBlock::kOne)) {
        const std::size_t middle = range.begin + split->counts[0];
        const auto parts = divide_at_bin(references, *split, to + range.begin, to + middle);
        return {ClusterRange{range.begin, middle, 1 - range.array, range.depth + 1, parts[0]},
                ClusterRange{middle, range.end, 1 - range.array, range.depth + 1, parts[1]}};
      }
    }
    const Division division = divide_at_median(references, range.bounds);
    const std::size_t middle = range.begin + division.middle;
    return {ClusterRange{range.begin, middle, range.array, range.depth + 1, division.parts[0]},
            ClusterRange{middle, range.end, range.array, range.depth + 1, division.parts[1]}};
  }

  /// A node and its box.
  std::pair<BvhNode, Box4> build_cluster(const KeyRange& keys, std::size_t depth, Subtree& subtree) const {
    BvhNode node{};
    Box4 box;
    if (keys.size() <= kLeafTriangles) {
      node.first = std::uint32_t(subtree.ids.size());
      node.count = std::uint32_t(keys.size());
      for (std::uint32_t i = keys.begin; i < keys.end; ++i) {
        subtree.ids.push_back(sorted_[i].id);
        box.extend(sorted_[i].box());
      }
    } else {
      const std::size_t pair = subtree.nodes.size();
      subtree.nodes.resize(pair + 2);
      node.first = std::uint32_t(pair);
      const std::uint32_t middle = depth < kMaxFreeDepth ? split(keys) : half(keys);
      const std::array<KeyRange, 2> parts{KeyRange{keys.begin, middle}, KeyRange{middle, keys.end}};
      for (std::size_t side = 0; side < 2; ++side) {
        const auto [child, child_box] = build_cluster(parts[side], depth + 1, subtree);
        subtree.nodes[pair + side] = child;
        box.extend(child_box);
      }
    }
    set_box(node, box);
    return {node, box};
  }

  static std::uint32_t half(const KeyRange& keys) { return keys.begin + std::uint32_t(keys.size() / 2); }
  [[nodiscard]] std::uint32_t split(const KeyRange& keys) const {
    return keys.begin + std::uint32_t(morton_split({keys_.data() + keys.begin, keys.size()}));
  }

  void make_clusters() {
    clusters_ = morton_ranges(keys_, kClusterTriangles);
    for (auto& array : arrays_) array = std::make_unique_for_overwrite<BuildReference[]>(clusters_.size());
    oneapi::tbb::parallel_for(
        std::size_t(0), (clusters_.size() + kTaskClusters - 1) / kTaskClusters, [&](std::size_t task) {
          const std::size_t end = std::min(clusters_.size(), (task + 1) * kTaskClusters);
          for (std::size_t i = task * kTaskClusters; i < end; ++i) {
            Box4 box;
            for (std::uint32_t k = clusters_[i].begin; k < clusters_[i].end; ++k)
              box.extend(sorted_[k].box());
            arrays_[0][i] = BuildReference::make(box, std::uint32_t(i));
          }
        });
    cluster_bounds_ = bounds_of({arrays_[0].get(), clusters_.size()});
  }

  std::stop_token stop_;
  SetBounds bounds_;
  AreaScale areas_;
  MortonKeys keys_;
  std::unique_ptr<BuildReference[]> sorted_;
  std::vector<KeyRange> clusters_;
  std::array<std::unique_ptr<BuildReference[]>, 2> arrays_;
  SetBounds cluster_bounds_;
};

}  // namespace

Result<BvhTree> build_morton_bvh(const mesh::TriangleMesh& mesh, std::stop_token stop) {
  if (mesh.triangle_count() > kMaxBvhPrimitives)
    return Error{ErrorCode::kLimitExceeded, "a BVH holds at most 2^31 triangles", "/triangles"};
  if (mesh.triangle_count() == 0) return BvhTree{};
  std::unique_ptr<Subtree> root = MortonBuilder(mesh, stop).run();
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the build was cancelled", {}};
  return flattened(std::move(root));
}

}  // namespace gridcast::blas
