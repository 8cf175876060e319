#include "core/blas/wide_bvh.h"

#include <algorithm>
#include <limits>

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/bvh_builder.h"
#include "core/blas/wide_collapse.h"

namespace gridcast::blas {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

Bounds3f bounds_of_block(const TriangleBlock& block) {
  Bounds3f box;
  // + 0: min and max of -0 and +0 would depend on their order.
  for (int corner = 0; corner < 3; ++corner)
    for (std::size_t lane = 0; lane < 4; ++lane) box.extend(block.corner(corner, lane) + 0.F);
  return box;
}

void load_corners(const mesh::TriangleMesh& mesh, TriangleBlock& block) {
  for (int lane = 0; lane < 4; ++lane) {
    const auto corners = mesh.corners(block.ids[lane]);
    for (int corner = 0; corner < 3; ++corner)
      for (int axis = 0; axis < 3; ++axis)
        block.corners[corner][axis][lane] = corners[std::size_t(corner)][axis];
  }
}

WideNode empty_node() {
  WideNode node{};
  for (std::uint32_t slot = 0; slot < 8; ++slot) node.set_box(slot, {Vec3f(kInfinity), Vec3f(-kInfinity)});
  return node;
}

/// Lays the collapsed tree out depth first: a node's inner children follow it, the first one at once.
class Layout {
 public:
  Layout(const BvhTree& tree, WideNodes& nodes, TriangleBlocks& blocks)
      : tree_(tree), collapse_(tree), nodes_(nodes), blocks_(blocks) {}

  void run() {
    nodes_.push_back(empty_node());
    if (collapse_.is_leaf(0)) {
      fill(0, {{0, true}});
    } else {
      fill(0, collapse_.slots(0));
    }
    while (!pending_.empty()) {
      const Pending next = pending_.back();
      pending_.pop_back();
      const auto index = std::uint32_t(nodes_.size());
      nodes_[next.parent].child[next.slot] = index;
      nodes_.push_back(empty_node());
      fill(index, collapse_.slots(next.binary_node));
    }
  }

 private:
  struct Pending {
    std::uint32_t binary_node, parent, slot;
  };

  void fill(std::uint32_t index, const std::vector<WideSlot>& slots) {
    nodes_[index].slots = std::uint32_t(slots.size());
    for (std::uint32_t slot = 0; slot < slots.size(); ++slot) {
      const std::uint32_t binary = slots[slot].binary_node;
      nodes_[index].set_box(slot, tree_.nodes[binary].bounds());
      if (slots[slot].leaf) nodes_[index].child[slot] = add_leaf(binary);
    }
    // Pushed in reverse: the first inner child is laid out next.
    for (std::uint32_t slot = std::uint32_t(slots.size()); slot-- > 0;)
      if (!slots[slot].leaf) pending_.push_back({slots[slot].binary_node, index, slot});
  }

  std::uint32_t add_leaf(std::uint32_t binary) {
    const auto first_block = std::uint32_t(blocks_.size());
    const std::uint32_t first = collapse_.first_primitive(binary);
    const std::uint32_t count = collapse_.primitive_count(binary);
    for (std::uint32_t begin = 0; begin < count; begin += 4) {
      TriangleBlock& block = blocks_.emplace_back();
      for (std::uint32_t lane = 0; lane < 4; ++lane)
        block.ids[lane] = tree_.primitive_ids[first + std::min(begin + lane, count - 1)];
    }
    return wide_child::leaf(first_block, std::uint32_t(blocks_.size()) - first_block);
  }

  const BvhTree& tree_;
  WideCollapse collapse_;
  WideNodes& nodes_;
  TriangleBlocks& blocks_;
  std::vector<Pending> pending_;
};

void load_all_corners(const mesh::TriangleMesh& mesh, TriangleBlocks& blocks) {
  oneapi::tbb::parallel_for(std::size_t(0), blocks.size(),
                            [&](std::size_t i) { load_corners(mesh, blocks[i]); });
}

}  // namespace

Result<std::shared_ptr<const WideBvh>> WideBvh::build(const mesh::TriangleMesh& mesh,
                                                      const BuildOptions& options, std::stop_token stop) {
  if (mesh.triangle_count() >= wide_child::kIndexMask)
    return Error{ErrorCode::kLimitExceeded, "more than 2^30 triangles in one mesh", "/triangles"};
  auto wide = std::make_shared<WideBvh>();
  if (mesh.triangles.empty()) return std::shared_ptr<const WideBvh>(wide);
  BvhBuildConfig config;
  config.block = LeafBlock::kFour;
  config.spatial = wide->spatial_ = options.spatial;
  Result<BvhTree> tree = build_bvh(mesh, config, std::move(stop));
  if (!tree) return tree.error();
  Layout(*tree, wide->nodes_, wide->blocks_).run();
  wide->blocks_.shrink_to_fit();
  wide->nodes_.shrink_to_fit();
  load_all_corners(mesh, wide->blocks_);
  return std::shared_ptr<const WideBvh>(wide);
}

Result<std::shared_ptr<const WideBvh>> WideBvh::refit(const mesh::TriangleMesh& moved) const {
  auto wide = std::make_shared<WideBvh>(*this);
  load_all_corners(moved, wide->blocks_);
  // Children come after their parents, so one pass backwards sees every child's box before it is needed.
  for (std::size_t i = wide->nodes_.size(); i-- > 0;) {
    WideNode& node = wide->nodes_[i];
    for (std::uint32_t slot = 0; slot < node.slots; ++slot) {
      const std::uint32_t link = node.child[slot];
      Bounds3f box;
      if (wide_child::is_leaf(link)) {
        for (std::uint32_t b = 0; b < wide_child::block_count(link); ++b)
          box.extend(bounds_of_block(wide->blocks_[wide_child::index(link) + b]));
      } else {
        const WideNode& child = wide->nodes_[link];
        for (std::uint32_t s = 0; s < child.slots; ++s) box.extend(child.box(s));
      }
      node.set_box(slot, box);
    }
  }
  return std::shared_ptr<const WideBvh>(wide);
}

}  // namespace gridcast::blas
