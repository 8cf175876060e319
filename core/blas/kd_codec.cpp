#include <algorithm>
#include <cmath>
#include <utility>

#include "core/blas/kd_tree.h"
#include "core/blas/tree_check.h"

namespace gridcast::blas {
namespace {

/// Treelets that link to later ones, each once, no deeper than a traversal's stack; leaves that share out the
/// blocks; numbers in range.
class Check {
 public:
  explicit Check(const KdLayout& layout)
      : layout_(layout),
        linked_(layout.treelets.size()),
        block_used_(layout.blocks.size()),
        depth_(layout.treelets.size(), 0) {}

  Status run() {
    if (layout_.treelets.empty())
      return layout_.blocks.empty() && layout_.triangles.empty() ? ok_status() : wrong_tree("has no root", 0);
    for (const KdBlock& block : layout_.blocks)
      for (const std::uint32_t triangle : block.triangles)
        if (triangle >= layout_.triangles.size()) return wrong_tree("names a triangle that is not there", 0);
    (void)linked_.name(0);
    for (std::size_t i = 0; i < layout_.treelets.size(); ++i)
      if (Status status = check_treelet(i); !status) return status;
    return linked_.all() && block_used_.all() ? ok_status()
                                              : wrong_tree("has parts that nothing links to", 0);
  }

 private:
  Status check_treelet(std::size_t index) {
    const KdTreelet& treelet = layout_.treelets[index];
    if (7 * (std::size_t(depth_[index]) + 1) > kKdStackSize) return wrong_tree("is too deep", index);
    if ((treelet.inner & ~treelet.used) != 0) return wrong_tree("has a child in an unused slot", index);
    for (std::uint32_t plane = 0; plane < KdTreelet::kPlanes; ++plane)
      if (treelet.axis(plane) > 2 || std::isnan(treelet.planes[plane]))
        return wrong_tree("has a plane without an axis or place", index);
    for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
      const bool leaf = treelet.is_used(slot) && !treelet.is_inner(slot);
      if (leaf != (treelet.block_count(slot) != 0)) return wrong_tree("has a slot with wrong blocks", index);
      if (treelet.is_inner(slot) ? !link(index, treelet.child(slot)) : !take_blocks(treelet, slot))
        return wrong_tree("has a link out of range, out of order or twice", index);
    }
    return ok_status();
  }

  bool link(std::size_t parent, std::size_t child) {
    if (child <= parent || child >= linked_.size() || !linked_.name(child)) return false;
    depth_[child] = std::uint16_t(depth_[parent] + 1);
    return true;
  }

  bool take_blocks(const KdTreelet& treelet, std::uint32_t slot) {
    const std::size_t first = treelet.block(slot), end = first + treelet.block_count(slot);
    if (end > block_used_.size()) return treelet.block_count(slot) == 0;
    for (std::size_t block = first; block < end; ++block)
      if (!block_used_.name(block)) return false;
    return true;
  }

  const KdLayout& layout_;
  Once linked_;
  Once block_used_;
  std::vector<std::uint16_t> depth_;
};

Status load_triangles(const std::vector<std::uint32_t>& ids, const mesh::TriangleMesh& mesh,
                      KdTriangles& triangles) {
  Once named(mesh.triangle_count());
  triangles.resize(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (ids[i] >= mesh.triangle_count() || !named.name(ids[i]))
      return wrong_tree("names a triangle twice, or one that the mesh has not", 0);
    triangles[i].id = ids[i];
    float* to = triangles[i].corners;
    for (const Vec3f& corner : mesh.corners(ids[i]))
      for (int axis = 0; axis < 3; ++axis) *to++ = corner[axis];
  }
  return ok_status();
}

}  // namespace

void KdTree::write(TreeWriter& out) const {
  out.reserve(layout_.treelets.size() * sizeof(KdTreelet) + layout_.blocks.size() * sizeof(KdBlock) +
              layout_.triangles.size() * sizeof(std::uint32_t) + 64);
  out.value(layout_.bounds.lower);
  out.value(layout_.bounds.upper);
  out.column(layout_.treelets);
  out.column(layout_.blocks);
  std::vector<std::uint32_t> ids(layout_.triangles.size());
  std::ranges::transform(layout_.triangles, ids.begin(), &KdTriangle::id);
  out.column(ids);
}

Result<std::shared_ptr<const KdTree>> KdTree::read(const mesh::TriangleMesh& mesh, TreeReader& in) {
  auto tree = std::make_shared<KdTree>();
  KdLayout& layout = tree->layout_;
  layout.bounds.lower = in.value<Vec3f>();
  layout.bounds.upper = in.value<Vec3f>();
  std::vector<std::uint32_t> ids;
  in.column(layout.treelets);
  in.column(layout.blocks);
  in.column(ids);
  if (in.failed()) return wrong_tree("is cut off", 0);
  if (layout.treelets.empty() != mesh.triangles.empty()) return wrong_tree("is of another mesh", 0);
  if (!(layout.bounds == mesh.bounds())) return wrong_tree("does not span the mesh's box", 0);
  if (Status status = load_triangles(ids, mesh, layout.triangles); !status) return status.error();
  if (Status status = Check(layout).run(); !status) return status.error();
  return std::shared_ptr<const KdTree>(std::move(tree));
}

}  // namespace gridcast::blas
