#include "core/blas/wide_layout.h"

#include <algorithm>
#include <limits>
#include <utility>

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/vertex_rows.h"
#include "core/blas/wide_collapse.h"

namespace gridcast::blas {
namespace {

/// Subtrees of at most this many triangles are laid out as one task.
constexpr std::uint32_t kTaskTriangles = 4096;

using BlockIds = std::array<std::uint32_t, 4>;

/// Nodes and blocks with links relative to their starts.
struct Fragment {
  std::uint32_t binary_root = 0;
  std::vector<WideNode> nodes;
  std::vector<BlockIds> blocks;
};

/// Lays out the binary subtree `root`. Subtrees small enough for a task are left to `on_subtree`, which
/// returns true when it takes one; the link to it is then the number of nodes and subtrees before it.
template <class OnSubtree>
class Layout {
 public:
  Layout(const BvhTree& tree, const WideCollapse& collapse, OnSubtree on_subtree)
      : tree_(tree), collapse_(collapse), on_subtree_(on_subtree) {}

  void run(Fragment& out) {
    out.nodes.push_back(empty_node());
    WideSlots slots;
    if (collapse_.is_leaf(out.binary_root)) {
      slots.add({out.binary_root, true});
    } else {
      slots = collapse_.slots(out.binary_root);
    }
    fill(0, slots, out);
    std::uint32_t next_link = 1;
    while (!pending_.empty()) {
      const Pending next = pending_.back();
      pending_.pop_back();
      out.nodes[next.parent].child[next.slot] = next_link++;
      if (on_subtree_(next.binary_node)) continue;
      out.nodes.push_back(empty_node());
      fill(std::uint32_t(out.nodes.size() - 1), collapse_.slots(next.binary_node), out);
    }
  }

 private:
  struct Pending {
    std::uint32_t binary_node, parent, slot;
  };

  void fill(std::uint32_t index, const WideSlots& slots, Fragment& out) {
    WideNode& node = out.nodes[index];
    node.slots = slots.size;
    for (std::uint32_t slot = 0; slot < slots.size; ++slot) {
      const std::uint32_t binary = slots.at[slot].binary_node;
      node.set_box(slot, tree_.nodes[binary].bounds());
      if (slots.at[slot].leaf) node.child[slot] = add_leaf(binary, out.blocks);
    }
    // Pushed in reverse: the first inner child is laid out next.
    for (std::uint32_t slot = slots.size; slot-- > 0;)
      if (!slots.at[slot].leaf) pending_.push_back({slots.at[slot].binary_node, index, slot});
  }

  std::uint32_t add_leaf(std::uint32_t binary, std::vector<BlockIds>& blocks) const {
    const auto first_block = std::uint32_t(blocks.size());
    const std::uint32_t first = collapse_.first_primitive(binary);
    const std::uint32_t count = collapse_.primitive_count(binary);
    for (std::uint32_t begin = 0; begin < count; begin += 4) {
      BlockIds& block = blocks.emplace_back();
      for (std::uint32_t lane = 0; lane < 4; ++lane)
        block[lane] = tree_.primitive_ids[first + std::min(begin + lane, count - 1)];
    }
    return wide_child::leaf(first_block, std::uint32_t(blocks.size()) - first_block);
  }

  const BvhTree& tree_;
  const WideCollapse& collapse_;
  OnSubtree on_subtree_;
  std::vector<Pending> pending_;
};

/// The nodes above the tasks, and the tasks, in the order of the final layout.
struct Plan {
  Fragment top;
  std::vector<Fragment> tasks;
  std::vector<std::uint32_t> task_of_item;  ///< by the numbers that the top's links hold; kNode for a node
  static constexpr std::uint32_t kNode = std::numeric_limits<std::uint32_t>::max();
};

Plan make_plan(const BvhTree& tree, const WideCollapse& collapse) {
  Plan plan;
  plan.task_of_item.push_back(Plan::kNode);
  Layout(tree, collapse, [&](std::uint32_t binary) {
    const bool small = collapse.primitive_count(binary) <= kTaskTriangles;
    plan.task_of_item.push_back(small ? std::uint32_t(plan.tasks.size()) : Plan::kNode);
    if (small) plan.tasks.emplace_back().binary_root = binary;
    return small;
  }).run(plan.top);
  oneapi::tbb::parallel_for(std::size_t(0), plan.tasks.size(), [&](std::size_t i) {
    Layout(tree, collapse, [](std::uint32_t /*binary*/) { return false; }).run(plan.tasks[i]);
  });
  return plan;
}

/// Copies a fragment's blocks to their place, with the corners of their triangles.
void place_blocks(const std::vector<BlockIds>& ids, const mesh::TriangleMesh& mesh, TriangleBlock* to) {
  const VertexRows vertices(mesh);
  for (const BlockIds& block : ids) {
    std::copy(block.begin(), block.end(), to->ids);
    (void)load_rows(vertices, mesh.triangles.data(), *to++);
  }
}

}  // namespace

WideNode empty_node() {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  WideNode node{};
  for (std::uint32_t slot = 0; slot < 8; ++slot) node.set_box(slot, {Vec3f(kInfinity), Vec3f(-kInfinity)});
  return node;
}

void swap_slots(WideNode& node, std::uint32_t a, std::uint32_t b) {
  for (auto& side : node.planes)
    for (auto& axis : side) std::swap(axis[a], axis[b]);
  std::swap(node.child[a], node.child[b]);
}

void lay_out(const BvhTree& tree, const mesh::TriangleMesh& mesh, WideNodes& nodes, TriangleBlocks& blocks) {
  const WideCollapse collapse(tree, kMaxWideLeaf);
  Plan plan = make_plan(tree, collapse);

  std::vector<std::uint32_t> item_begins, task_begins(plan.tasks.size()), block_begins;
  std::uint32_t node_count = 0;
  for (const std::uint32_t task : plan.task_of_item) {
    item_begins.push_back(node_count);
    if (task != Plan::kNode) task_begins[task] = node_count;
    node_count += task == Plan::kNode ? 1U : std::uint32_t(plan.tasks[task].nodes.size());
  }
  auto block_count = std::uint32_t(plan.top.blocks.size());
  for (const Fragment& task : plan.tasks) {
    block_begins.push_back(block_count);
    block_count += std::uint32_t(task.blocks.size());
  }
  nodes.resize(node_count);
  blocks.resize(block_count);

  std::size_t next_top = 0;
  for (std::size_t item = 0; item < item_begins.size(); ++item) {
    if (plan.task_of_item[item] != Plan::kNode) continue;
    WideNode node = plan.top.nodes[next_top++];
    for (std::uint32_t slot = 0; slot < node.slots; ++slot)
      if (!wide_child::is_leaf(node.child[slot])) node.child[slot] = item_begins[node.child[slot]];
    nodes[item_begins[item]] = node;
  }
  place_blocks(plan.top.blocks, mesh, blocks.data());
  oneapi::tbb::parallel_for(std::size_t(0), plan.tasks.size(), [&](std::size_t i) {
    for (std::size_t n = 0; n < plan.tasks[i].nodes.size(); ++n) {
      WideNode node = plan.tasks[i].nodes[n];
      // A leaf's link holds its first block in the low bits.
      for (std::uint32_t slot = 0; slot < node.slots; ++slot)
        node.child[slot] += wide_child::is_leaf(node.child[slot]) ? block_begins[i] : task_begins[i];
      nodes[task_begins[i] + n] = node;
    }
    place_blocks(plan.tasks[i].blocks, mesh, blocks.data() + block_begins[i]);
    plan.tasks[i] = {};
  });
}

}  // namespace gridcast::blas
