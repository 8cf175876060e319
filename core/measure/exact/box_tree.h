#pragma once
// A binary tree of boxes for the reference's own search: simple, and split at the median whatever comes.

#include <cstdint>
#include <span>
#include <stop_token>
#include <utility>
#include <vector>

#include "core/math/vec.h"
#include "core/measure/exact/filter.h"

namespace gridcast::measure::exact {

struct Box {
  Vec3d lower, upper;
};

class BoxTree {
 public:
  BoxTree() = default;
  /// Stopped, the tree is not to be used.
  explicit BoxTree(std::span<const Box> boxes, const std::stop_token& stop = {});

  /// Calls visit(index) for every box that may matter, nearer nodes first. `enter(box)` says which interval
  /// of t the ray spends in a box; nodes that it leaves before tnear or enters after limit(), asked anew each
  /// time, are skipped. visit returns false to end the search.
  template <class Enter, class Limit, class Visit>
  void search(Wide tnear, const Enter& enter, const Limit& limit, const Visit& visit) const {
    std::vector<std::pair<std::uint32_t, Wide>> stack;
    const auto push = [&](std::uint32_t node, const Interval& in) {
      if (in.enter <= in.exit && in.exit >= tnear) stack.emplace_back(node, in.enter);
    };
    if (!nodes_.empty()) push(0, enter(nodes_[0].box));
    while (!stack.empty()) {
      const auto [index, entered] = stack.back();
      stack.pop_back();
      if (entered > limit()) continue;
      const Node& node = nodes_[index];
      if (node.count > 0) {
        for (std::uint32_t i = node.first; i < node.first + node.count; ++i)
          if (!visit(items_[i])) return;
        continue;
      }
      const Interval left = enter(nodes_[node.first].box), right = enter(nodes_[node.first + 1].box);
      if (left.enter <= right.enter) {
        push(node.first + 1, right);
        push(node.first, left);
      } else {
        push(node.first, left);
        push(node.first + 1, right);
      }
    }
  }

 private:
  struct Node {
    Box box;
    std::uint32_t first = 0;  ///< left child, the right one follows; or first item of a leaf
    std::uint32_t count = 0;  ///< of items; 0 for an inner node
  };

  void split(std::uint32_t node, std::span<const Box> boxes);

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> items_;
};

}  // namespace gridcast::measure::exact
