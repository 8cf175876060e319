#include "core/blas/bvh_builder.h"

#include <memory>

#include <oneapi/tbb/parallel_invoke.h>

#include "core/blas/bvh_subtree.h"
#include "core/blas/cost_model.h"
#include "core/blas/spatial_split.h"
#include "core/math/uninitialized_allocator.h"

namespace gridcast::blas {
namespace {

/// Two arrays of references: a division copies from one to the other.
using References = std::vector<BuildReference, UninitializedAllocator<BuildReference>>;
using ReferenceArrays = std::array<References, 2>;

/// References to become a node at `depth`: `count` from `first` in one of the arrays. [begin, end) is theirs
/// in both.
struct Range {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::size_t first = 0;
  std::size_t count = 0;
  std::uint32_t array = 0;
  std::uint32_t depth = 0;
  SetBounds bounds;
  bool cut_above = false;  ///< whether a set that it is part of was divided in space
};
using Halves = std::array<Range, 2>;

BvhNode inner_node(const Range& range, std::size_t first_child) {
  BvhNode node{};
  set_box(node, range.bounds.boxes);
  node.first = std::uint32_t(first_child);
  return node;
}

/// Boxes whose tree one thread builds: some tens of microseconds.
constexpr std::size_t kTaskBoxes = 256;

class Builder {
 public:
  /// `splitter` may be null without spatial splits.
  Builder(ReferenceArrays& arrays, const AreaScale& areas, const SpatialSplitter* splitter,
          const BvhBuildConfig& config, std::stop_token stop)
      : arrays_(arrays), areas_(areas), splitter_(splitter), config_(config), stop_(std::move(stop)) {}

  [[nodiscard]] std::unique_ptr<Subtree> build(const Range& range) const {
    auto subtree = std::make_unique<Subtree>();
    if (stop_.stop_requested()) return subtree;
    if (range.count <= config_.task_size) {
      subtree->nodes.reserve(range.count);
      subtree->ids.reserve(range.count);
      subtree->root = build_inline(range, *subtree);
      subtree->count_own();
      return subtree;
    }
    const std::optional<Halves> halves = divide(range);  // never none: larger than a leaf
    tbb::parallel_invoke([&] { subtree->children[0] = build((*halves)[0]); },
                         [&] { subtree->children[1] = build((*halves)[1]); });
    subtree->root = inner_node(range, 0);
    subtree->count_children();
    return subtree;
  }

 private:
  /// Recursion is at most kMaxBvhDepth deep. `nodes` may move, so a child is written when it is complete.
  [[nodiscard]] BvhNode build_inline(const Range& range, Subtree& subtree) const {
    const std::optional<Halves> halves = divide(range);
    if (!halves) return make_leaf(range, subtree.ids);
    const std::size_t pair = subtree.nodes.size();
    subtree.nodes.resize(pair + 2);
    for (std::size_t side = 0; side < 2; ++side) {
      const BvhNode child = build_inline((*halves)[side], subtree);
      subtree.nodes[pair + side] = child;
    }
    return inner_node(range, pair);
  }

  [[nodiscard]] BvhNode make_leaf(const Range& range, std::vector<std::uint32_t>& ids) const {
    BvhNode node{};
    set_box(node, range.bounds.boxes);
    node.first = std::uint32_t(ids.size());
    node.count = std::uint32_t(range.count);
    for (const BuildReference& reference : span(range)) ids.push_back(reference.id);
    return node;
  }

  [[nodiscard]] std::span<BuildReference> span(const Range& range) const {
    return {arrays_[range.array].data() + range.first, range.count};
  }

  /// None when the range should be a leaf.
  [[nodiscard]] std::optional<Halves> divide(const Range& range) const {
    const bool may_be_leaf = range.count <= config_.max_leaf_size;
    if (range.count == 1) return std::nullopt;
    // Only halving is certain to end within the depth that a traversal has a stack for.
    if (range.depth >= kMaxFreeDepth || config_.split == BvhSplit::kMedian)
      return may_be_leaf ? std::nullopt : std::optional(halve(range));
    if (config_.split == BvhSplit::kMidpoint) {
      if (may_be_leaf) return std::nullopt;
      const std::optional<Division> division = divide_at_midpoint(span(range), range.bounds);
      return division ? halves(range, *division) : halve(range);
    }
    if (range.count == 2 && !may_be_leaf) return halve(range);  // there is no other way
    const std::size_t blocks = blocks_of(range.count, config_.block);
    const double as_leaf = kTriangleCost * double(blocks);
    // One node costs more than such a leaf, wherever it is split.
    if (may_be_leaf && as_leaf <= kNodeCost) return std::nullopt;
    const std::optional<BinnedSplit> split =
        find_binned_split(span(range), range.bounds, areas_, config_.block);
    if (may_be_leaf && (!split || node_cost(range, *split) >= as_leaf)) return std::nullopt;
    if (std::optional<Halves> halves = divide_in_space(range, split)) return halves;
    return split ? divide_at(range, *split) : halve(range);
  }

  /// None unless a plane in space is much cheaper than the best division by centers, and there is room.
  [[nodiscard]] std::optional<Halves> divide_in_space(const Range& range,
                                                      const std::optional<BinnedSplit>& other) const {
    const std::size_t room = range.end - range.begin;
    if (splitter_ == nullptr || room <= range.count || !other ||
        !splitter_->promising(*other, range.cut_above))
      return std::nullopt;
    const std::optional<SpatialSplit> split = splitter_->find(span(range), *other, range.bounds.boxes);
    if (!split) return std::nullopt;
    const std::optional<SpatialDivision> division =
        splitter_->divide(span(range), *split, {arrays_[1 - range.array].data() + range.begin, room});
    if (!division) return std::nullopt;
    Halves halves = shared_out(range, division->counts, division->parts);
    for (Range& half : halves) half.cut_above = true;
    return halves;
  }

  [[nodiscard]] double node_cost(const Range& range, const BinnedSplit& split) const {
    const float area = areas_.half_area(range.bounds.boxes);
    return kNodeCost + (area > 0.F ? kTriangleCost * double(split.cost / area) : 0.0);
  }

  [[nodiscard]] Halves halve(const Range& range) const {
    return halves(range, divide_at_median(span(range), range.bounds));
  }

  /// Of a division in place.
  static Halves halves(const Range& range, const Division& division) {
    const std::size_t middle = range.first + division.middle;
    return {Range{range.begin, middle, range.first, division.middle, range.array, range.depth + 1,
                  division.parts[0], range.cut_above},
            Range{middle, range.end, middle, range.count - division.middle, range.array, range.depth + 1,
                  division.parts[1], range.cut_above}};
  }

  [[nodiscard]] Halves divide_at(const Range& range, const BinnedSplit& split) const {
    BuildReference* to = arrays_[1 - range.array].data();
    return shared_out(range, split.counts,
                      divide_at_bin(span(range), split, to + range.begin, to + range.end - split.counts[1]));
  }

  /// The parts lie at both ends of the range's place in the other array; the room between them is shared out
  /// by what the parts cost.
  [[nodiscard]] Halves shared_out(const Range& range, const std::array<std::size_t, 2>& counts,
                                  const std::array<SetBounds, 2>& parts) const {
    const std::size_t right = range.end - counts[1];
    const std::size_t left_end = range.begin + counts[0];
    const double weights[2] = {double(counts[0]) * double(areas_.half_area(parts[0].boxes)),
                               double(counts[1]) * double(areas_.half_area(parts[1].boxes))};
    const double sum = weights[0] + weights[1];
    const double share = sum > 0.0 ? weights[0] / sum : 0.5;
    const std::size_t middle = left_end + std::size_t(double(right - left_end) * share);
    const std::uint32_t array = 1 - range.array;
    const bool cut = range.cut_above;
    return {Range{range.begin, middle, range.begin, counts[0], array, range.depth + 1, parts[0], cut},
            Range{middle, range.end, right, counts[1], array, range.depth + 1, parts[1], cut}};
  }

  ReferenceArrays& arrays_;
  const AreaScale& areas_;
  const SpatialSplitter* splitter_;
  const BvhBuildConfig& config_;
  std::stop_token stop_;
};

Error cancelled() {
  return {ErrorCode::kCancelled, "the build was cancelled", {}};
}

}  // namespace

Result<BvhTree> build_bvh(const mesh::TriangleMesh& mesh, const BvhBuildConfig& config,
                          std::stop_token stop) {
  const std::size_t count = mesh.triangle_count();
  if (count > kMaxBvhPrimitives)
    return Error{ErrorCode::kLimitExceeded, "a BVH holds at most 2^31 triangles", "/triangles"};
  if (count == 0) return BvhTree{};

  ReferenceArrays arrays;
  const std::size_t room =
      config.spatial == SpatialSplits::kNever ? count : std::size_t(double(count) * kMaxReferenceGrowth);
  for (auto& array : arrays) array.resize(room);
  const SetBounds bounds = make_references(mesh, arrays[0].data());
  const AreaScale areas(bounds.boxes.bounds());
  const SpatialSplitter splitter(mesh, areas, bounds.boxes, config.block);
  std::unique_ptr<Subtree> root =
      Builder(arrays, areas, &splitter, config, stop).build({0, room, 0, count, 0, 0, bounds});
  if (stop.stop_requested()) return cancelled();
  arrays = {};

  return flattened(std::move(root));
}

Result<BvhTree> build_bvh(std::span<const BuildReference> boxes, std::stop_token stop) {
  if (boxes.empty()) return BvhTree{};
  const SetBounds bounds = bounds_of(boxes);
  ReferenceArrays arrays;
  for (auto& array : arrays) array.resize(boxes.size());
  std::copy(boxes.begin(), boxes.end(), arrays[0].data());
  const AreaScale areas(bounds.boxes.bounds());
  const BvhBuildConfig config{.max_leaf_size = 1, .task_size = kTaskBoxes};
  std::unique_ptr<Subtree> root =
      Builder(arrays, areas, nullptr, config, stop).build({0, boxes.size(), 0, boxes.size(), 0, 0, bounds});
  if (stop.stop_requested()) return cancelled();
  return flattened(std::move(root));
}

}  // namespace gridcast::blas
