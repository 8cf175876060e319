#include "core/blas/wide_parts.h"

#include <algorithm>

namespace gridcast::blas {

WideParts::WideParts(const WideNodes& nodes) {
  if (!nodes.empty()) add(nodes, 0, nodes.size());
}

/// The node `self` and those below it, which fill [self, end): depth first, so each inner child's share
/// starts where the one's before it ends.
void WideParts::add(const WideNodes& nodes, std::size_t self, std::size_t end) {
  const auto part = std::uint32_t(all.size());
  if (end - self <= kMaxPartNodes) {
    subtrees.push_back(part);
    all.push_back({std::uint32_t(self), std::uint32_t(end), true});
    return;
  }
  all.push_back({std::uint32_t(self), std::uint32_t(self + 1), false});
  const std::size_t place = above.size();
  above.push_back({part, {}});
  const WideNode& node = nodes[self];
  for (std::uint32_t slot = 0; slot < node.slots; ++slot) {
    if (wide_child::is_leaf(node.child[slot])) continue;
    std::size_t child_end = end;
    for (std::uint32_t next = slot + 1; next < node.slots && child_end == end; ++next)
      if (!wide_child::is_leaf(node.child[next])) child_end = node.child[next];
    above[place].children[slot] = std::uint32_t(all.size());
    add(nodes, node.child[slot], child_end);
  }
}

std::size_t WideParts::part_of(std::uint32_t node) const {
  const auto after = std::upper_bound(all.begin(), all.end(), node,
                                      [](std::uint32_t n, const WidePart& part) { return n < part.begin; });
  return std::size_t(after - all.begin()) - 1;
}

}  // namespace gridcast::blas
