#include "core/blas/bvh_subtree.h"

#include <algorithm>
#include <utility>

#include <oneapi/tbb/parallel_invoke.h>

namespace gridcast::blas {
namespace {

/// Writes subtrees to their places, freeing them on the way.
class Flattener {
 public:
  explicit Flattener(BvhTree& tree) : tree_(tree) {}

  /// The root to `self`, the nodes below it from `base` on, the triangles from `first_id` on.
  void run(std::unique_ptr<Subtree> subtree, std::size_t self, std::size_t base, std::size_t first_id) {
    tree_.nodes[self] = placed(subtree->root, base, first_id);
    if (subtree->children[0] == nullptr) {
      for (std::size_t i = 0; i < subtree->nodes.size(); ++i)
        tree_.nodes[base + i] = placed(subtree->nodes[i], base, first_id);
      std::copy(subtree->ids.begin(), subtree->ids.end(),
                tree_.primitive_ids.begin() + std::ptrdiff_t(first_id));
      return;
    }
    const std::size_t second = base + 2 + subtree->children[0]->node_count;
    const std::size_t second_id = first_id + subtree->children[0]->id_count;
    tbb::parallel_invoke([&] { run(std::move(subtree->children[0]), base, base + 2, first_id); },
                         [&] { run(std::move(subtree->children[1]), base + 1, second, second_id); });
  }

 private:
  static BvhNode placed(BvhNode node, std::size_t base, std::size_t first_id) {
    node.first += std::uint32_t(node.leaf() ? first_id : base);
    return node;
  }
  BvhTree& tree_;
};

}  // namespace

BvhTree flattened(std::unique_ptr<Subtree> root) {
  BvhTree tree;
  tree.nodes.resize(2 + root->node_count);
  tree.primitive_ids.resize(root->id_count);
  Flattener(tree).run(std::move(root), 0, 2, 0);
  return tree;
}

}  // namespace gridcast::blas
