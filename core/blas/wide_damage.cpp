#include "core/blas/wide_damage.h"

#include <algorithm>
#include <functional>

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/float4.h"

namespace gridcast::blas {
namespace {

/// A triangle is built anew when this share of what the tree costs in the mean of a triangle is gained.
constexpr double kLeastGain = 0.25;
/// What a subtree costs to build beyond its triangles, in triangles.
constexpr double kSubtreeTriangles = 32.0;

void add_block(const TriangleBlock& block, PartSize& sum) {
  Float4 extent[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Float4 corners[3];
    for (std::size_t c = 0; c < 3; ++c) __builtin_memcpy(&corners[c], block.corners[c][axis], sizeof(Float4));
    extent[axis] =
        max(max(corners[0], corners[1]), corners[2]) - min(min(corners[0], corners[1]), corners[2]);
  }
  for (std::size_t lane = 0; lane < 4; ++lane) {
    if (lane > 0 && block.ids[lane] == block.ids[lane - 1]) break;  // the rest repeats the last one
    const double x = double(extent[0][lane]), y = double(extent[1][lane]), z = double(extent[2][lane]);
    sum.triangle_area += x * y + y * z + z * x;
    ++sum.triangles;
  }
}

/// Calls visit(part) for each inner child of a node above.
template <class Visit>
void for_each_child(const WideParts::Above& above, const Visit& visit) {
  for (const std::uint32_t child : above.children)
    if (child != 0) visit(child);
}

/// The choice between a subtree as a whole and the best of what is below it, from the leaves up.
class Chooser {
 public:
  Chooser(const WideParts& parts, std::span<const double> costs, std::span<const double> fresh,
          std::span<const PartSize> below)
      : parts_(parts), below_(below), at_(parts.all.size()), above_of_(parts.all.size(), nullptr) {
    for (std::size_t i = 0; i < at_.size(); ++i) at_[i] = {costs[i] - fresh[i], 0.0, parts.all[i].end};
    double cost = 0.0;
    for (const double part : costs) cost += part;
    price_ = kLeastGain * cost / double(below[0].triangles);
  }

  Damage run() {
    for (std::size_t i = parts_.all.size(); i-- > 0;)
      if (parts_.all[i].subtree) at_[i].best = std::max(0.0, as_a_whole(i));
    for (std::size_t i = parts_.above.size(); i-- > 0;) {
      const WideParts::Above& above = parts_.above[i];
      above_of_[above.part] = &above;
      Node& node = at_[above.part];
      for_each_child(above, [&](std::uint32_t child) {
        node.loss += at_[child].loss;
        node.best += at_[child].best;
        node.end = std::max(node.end, at_[child].end);
      });
      node.best_below = node.best;
      node.best = std::max(node.best_below, as_a_whole(above.part));
    }
    Damage damage;
    gather(0, damage);
    return damage;
  }

 private:
  struct Node {
    double loss;  ///< of the part, then of all below it: cost beyond a fresh one
    double best;  ///< the most that is to be had here
    std::uint32_t end;
    double best_below = 0.0;
  };

  [[nodiscard]] double as_a_whole(std::size_t part) const {
    return at_[part].loss - price_ * (double(below_[part].triangles) + kSubtreeTriangles);
  }

  void gather(std::uint32_t part, Damage& damage) const {
    const Node& node = at_[part];
    if (!(node.best > 0.0)) return;
    if (node.best > node.best_below) {
      damage.subtrees.push_back({parts_.all[part].begin, node.end});
      damage.triangles += below_[part].triangles;
      return;
    }
    for_each_child(*above_of_[part], [&](std::uint32_t child) { gather(child, damage); });
  }

  const WideParts& parts_;
  std::span<const PartSize> below_;
  std::vector<Node> at_;
  std::vector<const WideParts::Above*> above_of_;
  double price_ = 0.0;
};

}  // namespace

PartSize part_size(const WideNodes& nodes, const TriangleBlocks& blocks, const WidePart& part) {
  PartSize size;
  Bounds3f box;
  for (std::uint32_t slot = 0; slot < nodes[part.begin].slots; ++slot)
    box.extend(nodes[part.begin].box(slot));
  size.box_area = to_double(box).half_area();
  for (std::uint32_t i = part.begin; i < part.end; ++i) {
    for (std::uint32_t slot = 0; slot < nodes[i].slots; ++slot) {
      const std::uint32_t link = nodes[i].child[slot];
      if (!wide_child::is_leaf(link)) continue;
      for (std::uint32_t b = 0; b < wide_child::block_count(link); ++b)
        add_block(blocks[wide_child::index(link) + b], size);
    }
  }
  return size;
}

std::vector<PartSize> part_sizes(const WideNodes& nodes, const TriangleBlocks& blocks,
                                 const WideParts& parts) {
  std::vector<PartSize> own(parts.all.size());
  oneapi::tbb::parallel_for(std::size_t(0), own.size(),
                            [&](std::size_t i) { own[i] = part_size(nodes, blocks, parts.all[i]); });
  return own;
}

std::vector<PartSize> sizes_below(const WideParts& parts, std::span<const PartSize> own) {
  std::vector<PartSize> below(own.begin(), own.end());
  for (std::size_t i = parts.above.size(); i-- > 0;) {
    PartSize& sum = below[parts.above[i].part];
    for_each_child(parts.above[i], [&](std::uint32_t child) {
      sum.triangle_area += below[child].triangle_area;
      sum.triangles += below[child].triangles;
    });
  }
  return below;
}

std::vector<PartLooseness> part_looseness(std::span<const double> part_costs,
                                          std::span<const PartSize> below) {
  const auto ratio = [](double cost, double area) { return area > 0.0 ? cost / area : 0.0; };
  std::vector<PartLooseness> looseness(part_costs.size());
  for (std::size_t i = 0; i < looseness.size(); ++i)
    looseness[i] = {ratio(part_costs[i], below[i].triangle_area), ratio(part_costs[i], below[i].box_area)};
  return looseness;
}

std::vector<double> fresh_costs(std::span<const PartLooseness> looseness, std::span<const PartSize> below,
                                std::span<const double> part_costs) {
  std::vector<double> fresh(part_costs.begin(), part_costs.end());
  const auto lower = [](double& cost, double loose, double area) {
    if (loose > 0.0) cost = std::min(cost, loose * area);
  };
  for (std::size_t i = 0; i < fresh.size(); ++i) {
    lower(fresh[i], looseness[i].by_triangles, below[i].triangle_area);
    lower(fresh[i], looseness[i].by_box, below[i].box_area);
  }
  return fresh;
}

Damage find_damage(const WideParts& parts, std::span<const double> part_costs,
                   std::span<const double> fresh_costs, std::span<const PartSize> below) {
  return Chooser(parts, part_costs, fresh_costs, below).run();
}

}  // namespace gridcast::blas
