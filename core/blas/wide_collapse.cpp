#include "core/blas/wide_collapse.h"

#include <algorithm>
#include <limits>

#include "core/blas/cost_model.h"
#include "core/blas/wide_bvh.h"

namespace gridcast::blas {
WideCollapse::WideCollapse(const BvhTree& tree)
    : tree_(tree),
      cost_(tree.nodes.size()),
      count_(tree.nodes.size()),
      first_(tree.nodes.size()),
      leaf_(tree.nodes.size()) {
  // Children have larger indices than their parent; nodes[1] is unused.
  for (std::size_t i = tree.nodes.size(); i-- > 0;)
    if (i != 1) solve(std::uint32_t(i));
}

void WideCollapse::solve(std::uint32_t node) {
  const BvhNode& n = tree_.nodes[node];
  const double area = hit_probability(n.bounds(), tree_.nodes[0].bounds());
  count_[node] = n.leaf() ? n.count : count_[n.first] + count_[n.first + 1];
  first_[node] = n.leaf() ? n.first : std::min(first_[n.first], first_[n.first + 1]);
  const std::uint32_t blocks = (count_[node] + 3) / 4;
  const double as_leaf = count_[node] <= kMaxWideLeaf ? area * (kBlockCost / kWideNodeCost) * blocks
                                                      : std::numeric_limits<double>::infinity();
  Costs& cost = cost_[node];
  if (n.leaf()) {
    leaf_[node] = 1;
    cost.fill(float(as_leaf));
    return;
  }
  const Costs& left = cost_[n.first];
  const Costs& right = cost_[n.first + 1];
  auto distributed = [&](int slots) {
    float best = std::numeric_limits<float>::infinity();
    for (int k = 1; k < slots; ++k)
      best = std::min(best, left[std::size_t(k - 1)] + right[std::size_t(slots - k - 1)]);
    return best;
  };
  const double as_node = area + double(distributed(kSlots));
  leaf_[node] = as_leaf <= as_node ? 1 : 0;
  cost[0] = float(std::min(as_leaf, as_node));
  for (int slots = 2; slots < kSlots; ++slots)
    cost[std::size_t(slots - 1)] = std::min(cost[std::size_t(slots - 2)], distributed(slots));
}

int WideCollapse::best_left(std::uint32_t node, int slots) const {
  const BvhNode& n = tree_.nodes[node];
  int best = 1;
  float least = std::numeric_limits<float>::infinity();
  for (int k = 1; k < slots; ++k) {
    const float cost = cost_[n.first][std::size_t(k - 1)] + cost_[n.first + 1][std::size_t(slots - k - 1)];
    if (cost < least) {
      least = cost;
      best = k;
    }
  }
  return best;
}

void WideCollapse::gather(std::uint32_t node, int slots, std::vector<WideSlot>& out) const {
  const BvhNode& n = tree_.nodes[node];
  // The fewest slots that reach the least cost: cost never rises with the number of slots.
  while (slots > 1 && cost_[node][std::size_t(slots - 2)] <= cost_[node][std::size_t(slots - 1)]) --slots;
  if (slots == 1) {
    out.push_back({node, is_leaf(node)});
    return;
  }
  const int left = best_left(node, slots);
  gather(n.first, left, out);
  gather(n.first + 1, slots - left, out);
}

std::vector<WideSlot> WideCollapse::slots(std::uint32_t node) const {
  std::vector<WideSlot> out;
  const BvhNode& n = tree_.nodes[node];
  const int left = best_left(node, kSlots);
  gather(n.first, left, out);
  gather(n.first + 1, kSlots - left, out);
  return out;
}

}  // namespace gridcast::blas
