// What the traversal kernels need of a compact tree: planes decoded, corners gathered. Included once per
// instruction set (see hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_BLAS_COMPACT_KERNEL_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_COMPACT_KERNEL_INL_H
#undef GRIDCAST_BLAS_COMPACT_KERNEL_INL_H
#else
#define GRIDCAST_BLAS_COMPACT_KERNEL_INL_H
#endif

#include <hwy/highway.h>

#include "core/blas/compact_view.h"
#include "core/blas/wide_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

/// As CompactNode::plane, bit for bit.
HWY_INLINE hn::Vec<WideRay::D8> planes_of(const WideRay& /*r*/, const CompactNode& node, int axis,
                                          std::size_t place) {
  const WideRay::D8 d;
  const hn::Rebind<std::uint8_t, WideRay::D8> bytes;
  const hn::RebindToSigned<WideRay::D8> di;
  const auto q = hn::ConvertTo(d, hn::PromoteTo(di, hn::LoadU(bytes, &node.planes[0][0][0] + place)));
  return hn::MulAdd(q, hn::Set(d, node.step(axis)), hn::Set(d, node.origin[axis]));
}

#if HWY_TARGET == HWY_SCALAR
HWY_INLINE void gather_corners(const CompactView& tree, TriangleBlock& block) {
  load_corners(tree.triangles, tree.positions, block);
}
#else
/// x, y, z and anything, without a read beyond z.
HWY_INLINE Block4 load_corner(const Vec3f& p) {
  const BlockRay::D4 d;
#if HWY_TARGET <= HWY_AVX2 && HWY_ARCH_X86
  return hn::MaskedLoad(hn::FirstN(d, 3), d, &p.x);
#else
  const hn::Half<BlockRay::D4> half;
  return hn::Combine(d, hn::Set(half, p.z), hn::LoadU(half, &p.x));
#endif
}

/// Fills in the corners of the triangles that the block names: load_corners() by whole rows and columns,
/// since a column that was stored number by number is not there yet when it is loaded whole.
HWY_INLINE void gather_corners(const CompactView& tree, TriangleBlock& block) {
  const BlockRay::D4 d;
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

template <Precision kPrecision, Collector C>
HWY_INLINE Offer intersect_leaf(const CompactView& tree, std::uint32_t link, const BlockRay& r, float s_far,
                                C& collector) {
  const std::uint32_t* ids = tree.ids + compact_child::first_id(link);
  const std::uint32_t count = compact_child::count(link);
  Offer all = Offer::kGoOn;
  for (std::uint32_t begin = 0; begin < count; begin += 4) {
    TriangleBlock block;
    CompactView::name_triangles(ids + begin, count - begin, block);
    gather_corners(tree, block);
    const Offer offer = intersect_leaf<kPrecision>(&block, 1, r, s_far, collector);
    if (offer == Offer::kDone) return offer;
    if (offer == Offer::kNarrowed) all = offer;
  }
  return all;
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
