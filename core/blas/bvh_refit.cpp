#include <oneapi/tbb/parallel_invoke.h>

#include "core/blas/bvh.h"

namespace gridcast::blas {
namespace {

/// Subtrees of fewer nodes are refitted by one thread: some tens of microseconds.
constexpr std::size_t kTaskNodes = 4096;

class Refit {
 public:
  Refit(BvhNodes& nodes, const std::vector<std::uint32_t>& ids, const mesh::TriangleMesh& mesh)
      : nodes_(nodes), ids_(ids), mesh_(mesh) {}

  /// The boxes of `self` and of the nodes below it, which fill [begin, end): depth first, so the second
  /// child's share starts where the first one's ends.
  void subtree(std::size_t self, std::size_t begin, std::size_t end) {
    if (end - begin < kTaskNodes) {
      // Children come after their parents: backwards is bottom up.
      for (std::size_t i = end; i > begin; --i) node(i - 1);
    } else {
      const std::size_t first = nodes_[self].first;
      const std::size_t middle = nodes_[first + 1].leaf() ? end : nodes_[first + 1].first;
      tbb::parallel_invoke([&] { subtree(first, begin + 2, middle); },
                           [&] { subtree(first + 1, middle, end); });
    }
    node(self);
  }

 private:
  void node(std::size_t index) {
    BvhNode& node = nodes_[index];
    Bounds3f box;
    if (node.leaf()) {
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i)
        box.extend(primitive_bounds(mesh_, ids_[i]));
    } else {
      box = nodes_[node.first].bounds();
      box.extend(nodes_[node.first + 1].bounds());
    }
    node.lower = box.lower;
    node.upper = box.upper;
  }

  BvhNodes& nodes_;
  const std::vector<std::uint32_t>& ids_;
  const mesh::TriangleMesh& mesh_;
};

}  // namespace

Result<std::shared_ptr<const Bvh>> Bvh::refit(const mesh::TriangleMesh& moved) const {
  auto made = std::make_shared<Bvh>(*this);
  if (!made->nodes_.empty()) {
    Refit refit(made->nodes_, *primitive_ids_, moved);
    refit.subtree(0, 2, made->nodes_.size());
  }
  return std::shared_ptr<const Bvh>(std::move(made));
}

}  // namespace gridcast::blas
