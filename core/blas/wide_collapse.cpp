#include "core/blas/wide_collapse.h"

#include <algorithm>
#include <limits>

#include <oneapi/tbb/parallel_invoke.h>

#include "core/blas/cost_model.h"
#include "core/blas/wide_bvh.h"

namespace gridcast::blas {
namespace {

/// Subtrees of fewer nodes are solved by one thread.
constexpr std::size_t kTaskNodes = 4096;

}  // namespace

WideCollapse::WideCollapse(const BvhTree& tree, std::uint32_t max_leaf)
    : tree_(tree),
      max_leaf_(max_leaf),
      cost_(tree.nodes.size()),
      count_(tree.nodes.size()),
      first_(tree.nodes.size()),
      leaf_(tree.nodes.size()) {
  solve_subtree(0, 2, tree.nodes.size());
}

/// `self` and the nodes below it, which fill [begin, end): depth first, so the second child's share starts
/// where the first one's ends.
void WideCollapse::solve_subtree(std::size_t self, std::size_t begin, std::size_t end) {
  if (end - begin < kTaskNodes) {
    // Children come after their parents: backwards is bottom up.
    for (std::size_t i = end; i > begin; --i) solve(std::uint32_t(i - 1));
  } else {
    const std::size_t first = tree_.nodes[self].first;
    const std::size_t middle = tree_.nodes[first + 1].leaf() ? end : tree_.nodes[first + 1].first;
    oneapi::tbb::parallel_invoke([&] { solve_subtree(first, begin + 2, middle); },
                                 [&] { solve_subtree(first + 1, middle, end); });
  }
  solve(std::uint32_t(self));
}

void WideCollapse::solve(std::uint32_t node) {
  const BvhNode& n = tree_.nodes[node];
  const double area = hit_probability(n.bounds(), tree_.nodes[0].bounds());
  count_[node] = n.leaf() ? n.count : count_[n.first] + count_[n.first + 1];
  first_[node] = n.leaf() ? n.first : std::min(first_[n.first], first_[n.first + 1]);
  const std::uint32_t blocks = (count_[node] + 3) / 4;
  const double as_leaf = count_[node] <= max_leaf_ ? area * (kBlockCost / kWideNodeCost) * blocks
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

void WideCollapse::gather(std::uint32_t node, int slots, WideSlots& out) const {
  const BvhNode& n = tree_.nodes[node];
  // The fewest slots that reach the least cost: cost never rises with the number of slots.
  while (slots > 1 && cost_[node][std::size_t(slots - 2)] <= cost_[node][std::size_t(slots - 1)]) --slots;
  if (slots == 1) {
    out.add({node, is_leaf(node)});
    return;
  }
  const int left = best_left(node, slots);
  gather(n.first, left, out);
  gather(n.first + 1, slots - left, out);
}

void put_largest_leaf_first(const BvhTree& tree, WideSlots& slots) {
  std::uint32_t largest = 0;
  double area = -1.0;
  for (std::uint32_t i = 0; i < slots.size; ++i) {
    if (!slots.at[i].leaf) continue;
    const double own = to_double(tree.nodes[slots.at[i].binary_node].bounds()).half_area();
    if (!(own > area)) continue;
    area = own;
    largest = i;
  }
  std::swap(slots.at[0], slots.at[largest]);
}

WideSlots WideCollapse::slots(std::uint32_t node) const {
  WideSlots out;
  const BvhNode& n = tree_.nodes[node];
  const int left = best_left(node, kSlots);
  gather(n.first, left, out);
  gather(n.first + 1, kSlots - left, out);
  put_largest_leaf_first(tree_, out);
  return out;
}

}  // namespace gridcast::blas
