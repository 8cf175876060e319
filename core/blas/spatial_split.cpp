#include "core/blas/spatial_split.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/blas/triangle_boxes.h"

namespace gridcast::blas {
namespace {

constexpr std::size_t kBins = 16;

// Chosen on a scan, a terrain, a spiky ball, a city and a hall of pillars: what keeps most of the gain on the
// last two and leaves the others alone.

/// Smaller sets give little: with 256 instead the hall's cost falls by another 4 % for a quarter more time,
/// and the scan takes 1.8 times as long for nothing.
constexpr std::size_t kLeastSet = 1024;
/// Where no larger set around it was worth cutting, a smaller one than this hardly ever is: of 125 sets of a
/// scan 4 were, of 724 of a soup 84, for half of the time that looking took.
constexpr std::size_t kLeastUncutSet = 4096;
/// Unless a random ray meets the boxes of so many triangles: then small sets overlap as much as large ones.
constexpr double kCrowdedBoxes = 1024.0;
/// Overlaps of less than this share of the parts' common length save too little.
constexpr float kLeastLength = 0.05F;
/// What a reference more must save, in blocks per ray and per triangle of the mesh.
constexpr float kLeastSaving = 400.F;
/// Planes are chosen by about so many references of a set.
constexpr std::size_t kSampleSize = 256;
/// A box with this share of the set's area is looked at in any case: it may be what makes the parts overlap.
constexpr float kLargeShare = 0x1p-6F;
/// Axes shorter than this share of the longest are not cut.
constexpr float kLeastExtent = 0.01F;

bool is_empty(const Box4& box) {
  return !(box.lower[0] <= box.upper[0] && box.lower[1] <= box.upper[1] && box.lower[2] <= box.upper[2]);
}

/// Equal bins along one axis of a box. Bin i lies between planes[i] and planes[i + 1].
struct SpatialBins {
  std::array<float, kBins + 1> planes{};
  float scale = 0.F;
  std::array<Box4, kBins> boxes;
  std::array<std::uint32_t, kBins> begins{};  ///< references whose first bin this is
  std::array<std::uint32_t, kBins> ends{};    ///< references whose last bin this is

  SpatialBins(const Box4& box, int axis) {
    const float extent = box.upper[axis] - box.lower[axis];
    scale = float(kBins) / extent;
    for (std::size_t i = 0; i < kBins; ++i) planes[i] = box.lower[axis] + extent * (float(i) / float(kBins));
    planes[kBins] = std::numeric_limits<float>::infinity();
  }

  /// The bin that begins at or before `at`, by comparing with the planes themselves.
  [[nodiscard]] std::size_t bin_of(float at) const {
    auto bin = std::min(std::size_t(std::max((at - planes[0]) * scale, 0.F)), kBins - 1);
    while (bin > 0 && at < planes[bin]) --bin;
    while (at >= planes[bin + 1]) ++bin;
    return bin;
  }

  /// A reference that stands for `weight` like it.
  void add(const mesh::TriangleMesh& mesh, const BuildReference& reference, std::uint32_t weight, int axis) {
    Box4 rest = reference.box();
    const std::size_t first = bin_of(reference.lower[axis]);
    std::size_t last = bin_of(reference.upper[axis]);
    if (last > first && reference.upper[axis] <= planes[last]) --last;
    begins[first] += weight;
    ends[last] += weight;
    if (first < last) {
      const std::array<Vec3f, 3> corners = mesh.corners(reference.id);
      for (std::size_t bin = first; bin < last; ++bin) {
        const CutReference cut = cut_reference(corners, rest, axis, planes[bin + 1]);
        if (!is_empty(cut.left)) boxes[bin].extend(cut.left);
        rest = cut.right;
        if (is_empty(rest)) return;
      }
    }
    boxes[last].extend(rest);
  }
};

float blocks(std::size_t count, LeafBlock block) {
  return float(blocks_of(count, block));
}

/// Some of the references, each with how many it stands for: every large one, and of the others every so
/// many.
class Sample {
 public:
  struct Weighted {
    BuildReference reference;
    std::uint32_t weight;
  };

  Sample(std::span<const BuildReference> references, float large, const AreaScale& areas) {
    const auto stride = std::uint32_t(references.size() / kSampleSize + 1);
    references_.reserve(2 * kSampleSize + 1);
    std::size_t larges = 0, next = 0;
    for (std::size_t i = 0; i < references.size(); ++i) {
      const bool is_large = areas.half_area(references[i].box()) >= large && larges < kSampleSize;
      const bool is_next = i == next;  // every stride-th
      next += is_next ? stride : 0;
      if (!is_large && !is_next) continue;
      larges += is_large ? 1 : 0;
      references_.push_back({references[i], is_large ? 1 : stride});
    }
  }
  [[nodiscard]] const std::vector<Weighted>& references() const { return references_; }

  /// What the other way to divide costs, seen through the same sample.
  [[nodiscard]] float cost_of(const BinnedSplit& split, const AreaScale& areas, LeafBlock block) const {
    std::array<Box4, 2> boxes;
    std::array<std::size_t, 2> counts{};
    for (const auto& [reference, weight] : references_) {
      const std::size_t side = split.goes_right(reference) ? 1 : 0;
      boxes[side].extend(reference.box());
      counts[side] += weight;
    }
    float cost = 0.F;
    for (std::size_t side = 0; side < 2; ++side)
      if (counts[side] != 0) cost += areas.half_area(boxes[side]) * blocks(counts[side], block);
    return cost;
  }

 private:
  std::vector<Weighted> references_;
};

/// Keeps `best` unless a plane is strictly cheaper.
void sweep(const SpatialBins& bins, int axis, const AreaScale& areas, LeafBlock block,
           std::optional<SpatialSplit>& best) {
  std::array<Box4, kBins> right_boxes;
  std::array<std::size_t, kBins> right_counts{};
  Box4 box;
  std::size_t count = 0;
  for (std::size_t i = kBins - 1; i > 0; --i) {
    box.extend(bins.boxes[i]);
    right_boxes[i] = box;
    right_counts[i] = count += bins.ends[i];
  }
  box = {};
  count = 0;
  for (std::size_t i = 1; i < kBins; ++i) {
    box.extend(bins.boxes[i - 1]);
    count += bins.begins[i - 1];
    if (is_empty(box) || is_empty(right_boxes[i])) continue;
    const float cost = areas.half_area(box) * blocks(count, block) +
                       areas.half_area(right_boxes[i]) * blocks(right_counts[i], block);
    if (best && cost >= best->cost) continue;
    best = SpatialSplit{axis, bins.planes[i], cost, {count, right_counts[i]}, {box, right_boxes[i]}};
  }
}

}  // namespace

// Why nothing is lost. The triangle's part on one side of the plane is the hull of its corners there and of
// the points where edges cross the plane. With u = 2^-24 and m the largest coordinate, such a point is
// computed with an error below 16 u m on every axis: the quotient is off by 3 u of at most 1, its product
// with the difference by 5 u of at most 2 m, the sum by u of at most 3 m. A box around the corners and the
// crossings widened by that contains the part; cut with the plane and with `box` it contains the part within
// the cell. Where it comes out empty, so is the part. 2^-140 covers products that underflow.
CutReference cut_reference(const std::array<Vec3f, 3>& corners, const Box4& box, int axis, float plane) {
  CutReference cut;
  std::array<Float4, 3> points;
  Float4 largest = broadcast(0.F);
  for (std::size_t i = 0; i < 3; ++i) {
    points[i] = Float4{corners[i].x, corners[i].y, corners[i].z, 0.F} + broadcast(0.F);
    largest = max(max(points[i], -points[i]), largest);
  }
  const Float4 margin = broadcast(std::max({largest[0], largest[1], largest[2]}) * 0x1p-20F + 0x1p-140F);
  for (std::size_t i = 0; i < 3; ++i) {
    const Float4 a = points[i];
    const Float4 b = points[i == 2 ? 0 : i + 1];
    if (a[axis] <= plane) cut.left.extend(a);
    if (a[axis] >= plane) cut.right.extend(a);
    if ((a[axis] < plane) == (b[axis] < plane) && (a[axis] > plane) == (b[axis] > plane)) continue;
    if (a[axis] == plane || b[axis] == plane) continue;
    const Float4 crossing = a + (b - a) * broadcast((plane - a[axis]) / (b[axis] - a[axis]));
    const Box4 around{crossing - margin, crossing + margin};
    cut.left.extend(around);
    cut.right.extend(around);
  }
  cut.left.upper[axis] = std::min(cut.left.upper[axis], plane);
  cut.right.lower[axis] = std::max(cut.right.lower[axis], plane);
  cut.left.clip(box);
  cut.right.clip(box);
  return cut;
}

SpatialSplitter::SpatialSplitter(const mesh::TriangleMesh& mesh, const AreaScale& areas, const Box4& root,
                                 LeafBlock block)
    : mesh_(mesh),
      areas_(areas),
      block_(block),
      least_saving_(kLeastSaving * areas.half_area(root) / float(mesh.triangle_count())),
      least_uncut_set_(triangle_boxes_per_ray(mesh, root.bounds()) > kCrowdedBoxes ? kLeastSet
                                                                                   : kLeastUncutSet) {}

bool SpatialSplitter::promising(const BinnedSplit& split, bool cut_above) const {
  if (split.counts[0] + split.counts[1] < (cut_above ? kLeastSet : least_uncut_set_)) return false;
  const auto& [left, right] = split.boxes;
  const int axis = split.axis;
  Box4 overlap = left;
  overlap.clip(right);
  if (is_empty(overlap)) return false;
  const float length =
      std::max(left.upper[axis], right.upper[axis]) - std::min(left.lower[axis], right.lower[axis]);
  return overlap.upper[axis] - overlap.lower[axis] >= kLeastLength * length &&
         areas_.half_area(overlap) * blocks(split.counts[0] + split.counts[1], block_) >= least_saving_;
}

std::optional<SpatialSplit> SpatialSplitter::find(std::span<const BuildReference> references,
                                                  const BinnedSplit& other, const Box4& box) const {
  const Sample sample(references, areas_.half_area(box) * kLargeShare, areas_);
  std::optional<SpatialSplit> best;
  const Float4 extent = box.extent();
  const float longest = std::max({extent[0], extent[1], extent[2]});
  for (int axis = 0; axis < 3; ++axis) {
    // Planes closer than the rounding of the coordinates cut nothing off.
    const float magnitude = std::max(std::abs(box.lower[axis]), std::abs(box.upper[axis]));
    if (extent[axis] <= kLeastExtent * longest || extent[axis] <= magnitude * 0x1p-16F) continue;
    SpatialBins bins(box, axis);
    for (const auto& [reference, weight] : sample.references()) bins.add(mesh_, reference, weight, axis);
    sweep(bins, axis, areas_, block_, best);
  }
  if (!best) return best;
  const std::size_t more =
      best->counts[0] + best->counts[1] - std::min(references.size(), best->counts[0] + best->counts[1]);
  if (sample.cost_of(other, areas_, block_) - best->cost <= least_saving_ * float(more)) return std::nullopt;
  return best;
}

std::optional<SpatialDivision> SpatialSplitter::divide(std::span<const BuildReference> references,
                                                       const SpatialSplit& split,
                                                       std::span<BuildReference> room) const {
  SpatialDivision result;
  auto put_left = [&](const BuildReference& reference) {
    room[result.counts[0]++] = reference;
    result.parts[0].extend(reference);
  };
  auto put_right = [&](const BuildReference& reference) {
    room[room.size() - ++result.counts[1]] = reference;
    result.parts[1].extend(reference);
  };
  auto cost = [&](const Box4& l, std::size_t lefts, const Box4& r, std::size_t rights) {
    return areas_.half_area(l) * float(lefts) + areas_.half_area(r) * float(rights);
  };
  std::array<std::size_t, 2> counts = split.counts;
  for (std::size_t i = 0; i < references.size(); ++i) {
    const BuildReference& reference = references[i];
    if (room.size() - result.counts[0] - result.counts[1] < references.size() - i + 1) return std::nullopt;
    if (reference.lower[split.axis] >= split.plane) {
      put_right(reference);
      continue;
    }
    if (reference.upper[split.axis] <= split.plane) {
      put_left(reference);
      continue;
    }
    const CutReference cut =
        cut_reference(mesh_.corners(reference.id), reference.box(), split.axis, split.plane);
    Box4 with_left = split.boxes[0];
    with_left.extend(reference.box());
    Box4 with_right = split.boxes[1];
    with_right.extend(reference.box());
    const float both = cost(split.boxes[0], counts[0], split.boxes[1], counts[1]);
    const float only_left = cost(with_left, counts[0], split.boxes[1], counts[1] - 1);
    const float only_right = cost(split.boxes[0], counts[0] - 1, with_right, counts[1]);
    if (is_empty(cut.right) || (only_left <= both && only_left <= only_right)) {
      put_left(reference);
      --counts[1];
    } else if (is_empty(cut.left) || only_right <= both) {
      put_right(reference);
      --counts[0];
    } else {
      put_left(BuildReference::make(cut.left, reference.id));
      put_right(BuildReference::make(cut.right, reference.id));
    }
  }
  if (result.counts[0] == 0 || result.counts[1] == 0) return std::nullopt;
  return result;
}

}  // namespace gridcast::blas
