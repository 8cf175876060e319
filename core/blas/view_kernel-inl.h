// What the kernels need of the layouts of a tree of eight children a node: planes as floats, leaves as
// blocks. Included once per instruction set (see hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_BLAS_VIEW_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_VIEW_KERNEL_INL_H
#undef GRIDCAST_BLAS_VIEW_KERNEL_INL_H
#else
#define GRIDCAST_BLAS_VIEW_KERNEL_INL_H
#endif

#include <hwy/highway.h>

#include "core/blas/compact_view.h"
#include "core/blas/wide_view.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// As many planes of one axis as there are lanes, from a place in `planes` on: [lower, upper][axis][slot].
template <class D>
HWY_INLINE hn::Vec<D> planes_of(D d, const WideNode& node, int /*axis*/, std::size_t place) {
  return hn::Load(d, &node.planes[0][0][0] + place);
}
/// As CompactNode::plane, bit for bit.
template <class D>
HWY_INLINE hn::Vec<D> planes_of(D d, const CompactNode& node, int axis, std::size_t place) {
  const hn::Rebind<std::uint8_t, D> bytes;
  const hn::RebindToSigned<D> di;
  const auto q = hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(bytes, &node.planes[0][0][0] + place)));
  return hn::MulAdd(q, hn::Set(d, node.step(axis)), hn::Set(d, node.origin[axis]));
}

/// One of them.
HWY_INLINE float plane_of(const WideNode& node, int /*axis*/, std::size_t place) {
  return (&node.planes[0][0][0])[place];
}
HWY_INLINE float plane_of(const CompactNode& node, int axis, std::size_t place) {
  return node.origin[axis] + float((&node.planes[0][0][0])[place]) * node.step(axis);
}

#if HWY_TARGET == HWY_SCALAR
HWY_INLINE void gather_corners(const CompactView& tree, TriangleBlock& block) {
  load_corners(tree.triangles, tree.positions, block);
}
#else
/// x, y, z and anything, without a read beyond z.
HWY_INLINE hn::Vec<hn::CappedTag<float, 4>> load_corner(const Vec3f& p) {
  const hn::CappedTag<float, 4> d;
#if HWY_TARGET <= HWY_AVX2 && HWY_ARCH_X86
  return hn::MaskedLoad(hn::FirstN(d, 3), d, &p.x);
#else
  const hn::Half<hn::CappedTag<float, 4>> half;
  return hn::Combine(d, hn::Set(half, p.z), hn::LoadU(half, &p.x));
#endif
}

/// Fills in the corners of the triangles that the block names: load_corners() by whole rows and columns,
/// since a column that was stored number by number is not there yet when it is loaded whole.
HWY_INLINE void gather_corners(const CompactView& tree, TriangleBlock& block) {
  const hn::CappedTag<float, 4> d;
  const mesh::Triangle* const triangles[4] = {&tree.triangles[block.ids[0]], &tree.triangles[block.ids[1]],
                                              &tree.triangles[block.ids[2]], &tree.triangles[block.ids[3]]};
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const auto row = [&](int lane) { return load_corner(tree.positions[(*triangles[lane])[corner]]); };
    const auto p0 = row(0), p1 = row(1), p2 = row(2), p3 = row(3);
    const auto xy02 = hn::InterleaveLower(d, p0, p2), xy13 = hn::InterleaveLower(d, p1, p3);
    const auto z02 = hn::InterleaveUpper(d, p0, p2), z13 = hn::InterleaveUpper(d, p1, p3);
    hn::Store(hn::InterleaveLower(d, xy02, xy13), d, block.corners[corner][0]);
    hn::Store(hn::InterleaveUpper(d, xy02, xy13), d, block.corners[corner][1]);
    hn::Store(hn::InterleaveLower(d, z02, z13), d, block.corners[corner][2]);
  }
}
#endif

/// The triangles of a leaf as one or two blocks, whose number it returns. Both are gathered before the first
/// is tested, so that the waits for scattered memory overlap.
HWY_INLINE std::uint32_t gather_leaf(const CompactView& tree, std::uint32_t link,
                                     TriangleBlock (&blocks)[2]) {
  const std::uint32_t* const ids = tree.ids + compact_child::first_id(link);
  const std::uint32_t count = compact_child::count(link);
  CompactView::name_triangles(ids, count, blocks[0]);
  gather_corners(tree, blocks[0]);
  if (count <= 4) return 1;
  CompactView::name_triangles(ids + 4, count - 4, blocks[1]);
  gather_corners(tree, blocks[1]);
  return 2;
}

/// Asks for the memory of a node or of the first block of a leaf that will be looked at soon: with trees
/// larger than the second-level cache that is what a ray waits for most. Without a branch, since which of the
/// two it is is hard to foresee; that may ask for a line behind a block.
HWY_INLINE void prefetch(const WideView& tree, std::uint32_t link) {
  constexpr std::size_t kLine = 64, kLines = sizeof(WideNode) / kLine;
  const bool leaf = wide_child::is_leaf(link);
  const void* const first = leaf ? static_cast<const void*>(tree.blocks) : tree.nodes;
  const std::size_t size = leaf ? sizeof(TriangleBlock) : sizeof(WideNode);
  const auto* const place = static_cast<const std::byte*>(first) + size * wide_child::index(link);
  for (std::size_t line = 0; line < kLines; ++line) __builtin_prefetch(place + kLine * line);
}
/// Only the ids of a leaf, with which its wait for corners begins.
HWY_INLINE void prefetch(const CompactView& tree, std::uint32_t link) {
  if (wide_child::is_leaf(link)) __builtin_prefetch(tree.ids + compact_child::first_id(link));
}

/// Hit::corners_at of a lane of a block that for_leaf() showed.
HWY_INLINE std::uint32_t place_of(const WideView& tree, const TriangleBlock& block, std::size_t lane) {
  return corners_at(std::size_t(&block - tree.blocks), lane);
}
HWY_INLINE std::uint32_t place_of(const CompactView& /*tree*/, const TriangleBlock& /*block*/,
                                  std::size_t /*lane*/) {
  return kInvalidId;
}

/// Calls visit(block) for each block of a leaf, until it returns false.
template <class Visit>
HWY_INLINE void for_leaf(const WideView& tree, std::uint32_t link, const Visit& visit) {
  const TriangleBlock* block = tree.blocks + wide_child::index(link);
  for (std::uint32_t count = wide_child::block_count(link); count != 0; --count, ++block)
    if (!visit(*block)) return;
}
template <class Visit>
HWY_INLINE void for_leaf(const CompactView& tree, std::uint32_t link, const Visit& visit) {
  TriangleBlock blocks[2];
  const std::uint32_t count = gather_leaf(tree, link, blocks);
  for (std::uint32_t i = 0; i < count; ++i)
    if (!visit(blocks[i])) return;
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
