#include "core/blas/wide_cost.h"

#include <oneapi/tbb/parallel_for.h>

namespace gridcast::blas {
namespace {

Bounds3f box_of(const WideNode& node) {
  Bounds3f box;
  for (std::uint32_t slot = 0; slot < node.slots; ++slot) box.extend(node.box(slot));
  return box;
}

/// Where the root has no area: hit_probability compares lengths.
double flat_cost(const WideNodes& nodes, const Bounds3f& root) {
  double cost = 0.0;
  for (const WideNode& node : nodes)
    for (std::uint32_t slot = 0; slot < node.slots; ++slot)
      cost += WideCostSum::weight(node.child[slot]) * hit_probability(node.box(slot), root);
  return cost;
}

}  // namespace

double part_cost(const WideNodes& nodes, const WidePart& part) {
  WideCostSum cost;
  for (std::size_t i = part.end; i-- > part.begin;) cost.add(nodes[i].planes, nodes[i].child, nodes[i].slots);
  return cost.sum();
}

std::vector<double> part_costs(const WideNodes& nodes, const WideParts& parts) {
  std::vector<double> costs(parts.all.size());
  oneapi::tbb::parallel_for(std::size_t(0), costs.size(),
                            [&](std::size_t i) { costs[i] = part_cost(nodes, parts.all[i]); });
  return costs;
}

double tree_cost(const WideNodes& nodes, std::span<const double> part_costs) {
  if (nodes.empty()) return 0.0;
  const Bounds3f root = box_of(nodes[0]);
  const double area = to_double(root).half_area();
  if (!(area > 0.0)) return kWideNodeCost + flat_cost(nodes, root);
  double sum = 0.0;
  for (const double cost : part_costs) sum += cost;
  return kWideNodeCost + sum / area;
}

}  // namespace gridcast::blas
