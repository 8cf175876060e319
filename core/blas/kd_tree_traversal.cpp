// The traversal kernel, compiled once per instruction set and chosen at run time by Highway.
// All of it only culls; mesh::intersect_triangle decides, in scalar double, so hits are the same on each.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/blas/kd_tree_traversal.cpp"  // NOLINT: Highway includes this file once per target

#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/blas/block_filter-inl.h"
#include "core/blas/kd_tree.h"
#include "core/blas/kernel_steps.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// What is still to visit. `key` orders by the bits of s_enter, which compare like the floats, and holds the
/// treelet or first block in its low half.
struct StackEntry {
  std::int64_t key;
  float exit;
  std::uint32_t blocks;  ///< 0: a treelet
};

inline std::int64_t make_key(float s_enter, std::uint32_t link) {
  std::int32_t bits;
  __builtin_memcpy(&bits, &s_enter, 4);
  bits ^= (bits >> 31) & 0x7FFFFFFF;  // negative floats order backwards
  return (std::int64_t(bits) << 32) | std::int64_t(link);
}
inline float enter_of(std::int64_t key) {
  auto bits = std::int32_t(key >> 32);
  bits ^= (bits >> 31) & 0x7FFFFFFF;
  float s_enter;
  __builtin_memcpy(&s_enter, &bits, 4);
  return s_enter;
}

// A plane is met not at one s but within [lower, upper], which holds the s of every hit whose triangle has
// its point in the plane: such hits belong to both sides, those on the near side lie at upper or before,
// those on the far side at lower or after. So the segment of a slot, the treelet's cut by its half spaces,
// holds the s of every hit on a point of its closed cell.

#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2

using D8 = hn::CappedTag<float, 8>;
using V8 = hn::Vec<D8>;

/// The ray's culling constants, by axis.
struct KdRay {
  explicit HWY_INLINE KdRay(const mesh::ObjectRay& r)
      : block(r),
        inverse(spread(r.inverse_direction)),
        near_offset(spread(r.near_offset)),
        far_offset(spread(r.far_offset)) {}

  /// From three broadcasts: one load would wait for the stores that have just written the vector.
  static HWY_INLINE V8 spread(const Vec3f& v) {
    const D8 d;
    return hn::IfThenElse(hn::FirstN(d, 1), hn::Set(d, v.x),
                          hn::IfThenElse(hn::FirstN(d, 2), hn::Set(d, v.y), hn::Set(d, v.z)));
  }

  BlockRay block;
  V8 inverse, near_offset, far_offset;
};

/// Lane i: the value of code i among 16, eight for the sides below and eight for those above.
HWY_INLINE V8 look_up(V8 below, V8 above, hn::Vec<hn::RebindToUnsigned<D8>> codes) {
#if HWY_TARGET <= HWY_AVX3
  return V8{_mm256_permutex2var_ps(below.raw, codes.raw, above.raw)};
#else
  // The permutation looks at three bits alone.
  const __m256 side = _mm256_castsi256_ps(_mm256_slli_epi32(codes.raw, 28));
  return V8{_mm256_blendv_ps(_mm256_permutevar8x32_ps(below.raw, codes.raw),
                             _mm256_permutevar8x32_ps(above.raw, codes.raw), side)};
#endif
}

HWY_INLINE std::uint32_t enter_slots(const KdTreelet& treelet, const KdRay& r, float s_enter, float s_exit,
                                     SlotSegments& out) {
  const D8 d;
  const hn::RebindToUnsigned<D8> du;
  alignas(32) static constexpr std::uint32_t kAxisShifts[8] = {0, 2, 4, 6, 8, 10, 12, 14};
  const auto axes = hn::IndicesFromVec(
      d,
      hn::And(hn::Shr(hn::Set(du, std::uint32_t(treelet.axes)), hn::Load(du, kAxisShifts)), hn::Set(du, 3U)));
  const auto inverse = hn::TableLookupLanes(r.inverse, axes);
  const auto planes = hn::Load(d, treelet.planes);
  const auto lower = hn::MulAdd(planes, inverse, hn::TableLookupLanes(r.near_offset, axes));
  const auto upper = hn::MulAdd(planes, inverse, hn::TableLookupLanes(r.far_offset, axes));
  const auto backward = hn::Lt(inverse, hn::Zero(d));
  const auto always = hn::Set(d, hwy::HighestValue<float>());
  const auto never = hn::Neg(always);
  const auto enter_below = hn::IfThenElse(backward, lower, never);
  const auto enter_above = hn::IfThenElse(backward, never, lower);
  const auto exit_below = hn::IfThenElse(backward, always, upper);
  const auto exit_above = hn::IfThenElse(backward, upper, always);

  auto codes = hn::PromoteTo(du, hn::Load(hn::Rebind<std::uint16_t, D8>(), treelet.path));
  auto enter = hn::Set(d, s_enter);
  auto exit = hn::Set(d, s_exit);
  for (std::uint32_t side = 0; side < KdTreelet::kSides; ++side) {
    enter = hn::Max(enter, look_up(enter_below, enter_above, codes));
    exit = hn::Min(exit, look_up(exit_below, exit_above, codes));
    codes = hn::ShiftRight<4>(codes);
  }
  hn::Store(enter, d, out.enter);
  hn::Store(exit, d, out.exit);
  std::uint8_t bits[8] = {0};
  hn::StoreMaskBits(d, hn::Le(enter, exit), bits);
  return std::uint32_t(bits[0]) & treelet.used;
}

#else

struct KdRay {
  explicit HWY_INLINE KdRay(const mesh::ObjectRay& r) : block(r) {}
  BlockRay block;
};

/// The same slot by slot, where vectors are shorter than the tables.
HWY_INLINE std::uint32_t enter_slots(const KdTreelet& treelet, const KdRay& r, float s_enter, float s_exit,
                                     SlotSegments& out) {
  const mesh::ObjectRay& ray = r.block.ray;
  constexpr float kAlways = hwy::HighestValue<float>();
  float enters[16], exits[16];
  for (std::uint32_t plane = 0; plane < KdTreelet::kPlanes; ++plane) {
    const int axis = treelet.axis(plane);
    const float inverse = ray.inverse_direction[axis];
    const float at_plane = treelet.planes[plane] * inverse;
    const bool backward = inverse < 0.F;
    enters[plane] = backward ? at_plane + ray.near_offset[axis] : -kAlways;
    enters[plane + 8] = backward ? -kAlways : at_plane + ray.near_offset[axis];
    exits[plane] = backward ? kAlways : at_plane + ray.far_offset[axis];
    exits[plane + 8] = backward ? at_plane + ray.far_offset[axis] : kAlways;
  }
  std::uint32_t hits = 0;
  for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
    out.enter[slot] = s_enter;
    out.exit[slot] = s_exit;
    for (std::uint32_t codes = treelet.path[slot], side = 0; side < KdTreelet::kSides; ++side, codes >>= 4) {
      out.enter[slot] = std::max(out.enter[slot], enters[codes & 15U]);
      out.exit[slot] = std::min(out.exit[slot], exits[codes & 15U]);
    }
    hits |= std::uint32_t(out.enter[slot] <= out.exit[slot]) << slot;
  }
  return hits & treelet.used;
}

#endif

/// The columns of four triangles.
HWY_INLINE void gather(const KdTriangle* triangles, const KdBlock& block, TriangleBlock& out) {
  [[maybe_unused]] const BlockRay::D4 d;
  for (std::size_t corner = 0; corner < 3; ++corner) {
#if HWY_TARGET == HWY_SCALAR
    for (std::size_t lane = 0; lane < 4; ++lane)
      for (std::size_t axis = 0; axis < 3; ++axis)
        out.corners[corner][axis][lane] = triangles[block.triangles[lane]].corners[3 * corner + axis];
#else
    // The fourth lane is the next number in memory, a corner's or the id, and is not used.
    const auto a = hn::LoadU(d, triangles[block.triangles[0]].corners + 3 * corner);
    const auto b = hn::LoadU(d, triangles[block.triangles[1]].corners + 3 * corner);
    const auto c = hn::LoadU(d, triangles[block.triangles[2]].corners + 3 * corner);
    const auto e = hn::LoadU(d, triangles[block.triangles[3]].corners + 3 * corner);
    const auto ab = hn::InterleaveLower(d, a, b);
    const auto ce = hn::InterleaveLower(d, c, e);
    hn::Store(hn::ConcatLowerLower(d, ce, ab), d, out.corners[corner][0]);
    hn::Store(hn::ConcatUpperUpper(d, ce, ab), d, out.corners[corner][1]);
    hn::Store(hn::ConcatLowerLower(d, hn::InterleaveUpper(d, c, e), hn::InterleaveUpper(d, a, b)), d,
              out.corners[corner][2]);
#endif
  }
}

/// Tests `count` consecutive blocks; what was said to the hits together.
template <Precision kPrecision, Collector C>
HWY_INLINE Offer intersect_blocks(const KdTriangle* triangles, const KdBlock* block, std::uint32_t count,
                                  const BlockRay& r, float s_exit, C& collector) {
  Offer all = Offer::kGoOn;
  TriangleBlock columns;
  for (; count != 0; --count, ++block) {
    gather(triangles, *block, columns);
    // A hit beyond the leaf's cell is found in the leaf where it lies.
    const BlockHits hits = filter_block < kPrecision,
                    C::kStopsAtFirst ? Certain::kAsked : Certain::kNotAsked > (columns, r, s_exit);
    for (std::uint32_t certain = hits.certain; certain != 0; certain &= certain - 1)
      if (triangles[block->triangles[__builtin_ctz(certain)]].id != r.ray.excluded_primitive)
        return Offer::kDone;
    for (std::uint32_t candidates = hits.possible; candidates != 0; candidates &= candidates - 1) {
      const KdTriangle& triangle = triangles[block->triangles[__builtin_ctz(candidates)]];
      const Offer offer = test_triangle<kPrecision>(r.ray, triangle.corner(0), triangle.corner(1),
                                                    triangle.corner(2), triangle.id, collector);
      if (offer == Offer::kDone) return offer;
      if (offer == Offer::kNarrowed) all = offer;
    }
  }
  return all;
}

/// mesh::intersect_box with the far end as well.
HWY_INLINE bool clip_to_root(const mesh::ObjectRay& ray, const Bounds3f& box, float& enter, float& exit) {
  if (!mesh::intersect_box(ray, box.lower, box.upper, exit, enter)) return false;
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = ray.inverse_direction[axis];
    const float far_plane = inverse >= 0.F ? box.upper[axis] : box.lower[axis];
    exit = std::min(exit, far_plane * inverse + ray.far_offset[axis]);
  }
  return true;
}

// Front to back: the stack holds what is still to visit, nearest on top, entries of one treelet inserted in
// order. Cells follow each other along the ray, so after a hit what lies behind it is beyond s_far and the
// walk ends at the first leaf with a hit inside. Because every point of a triangle lies in a leaf that lists
// it, the leaf of the winning hit is reached whatever the rounding.
template <Precision kPrecision, Collector C>
HWY_INLINE bool traverse(const KdLayout& tree, const mesh::ObjectRay& ray, C& collector) {
  float s_far = ray.cull_far(collector.tfar());
  float s_enter, s_exit = s_far;
  if (!clip_to_root(ray, tree.bounds, s_enter, s_exit)) return false;
  const KdTreelet* const treelets = tree.treelets.data();
  const KdBlock* const blocks = tree.blocks.data();
  const KdTriangle* const triangles = tree.triangles.data();
  const KdRay r(ray);
  StackEntry stack[kKdStackSize];
  std::size_t size = 0;
  bool narrowed = false;
  StackEntry next{make_key(s_enter, 0), s_exit, 0};
  SlotSegments segments;
  for (;;) {
    const auto link = std::uint32_t(next.key);
    if (next.blocks == 0) {
      const KdTreelet& treelet = treelets[link];
      std::uint32_t hits = enter_slots(treelet, r, enter_of(next.key), std::min(next.exit, s_far), segments);
      if (hits != 0) {
        const auto entry_of = [&](std::uint32_t slot) {
          const bool inner = treelet.is_inner(slot);
          const std::uint32_t to = inner ? treelet.child(slot) : treelet.block(slot);
          if (inner) hwy::Prefetch(treelets + to);
          return StackEntry{make_key(segments.enter[slot], to), segments.exit[slot],
                            treelet.block_count(slot)};
        };
        next = entry_of(std::uint32_t(__builtin_ctz(hits)));
        const std::size_t bottom = size;
        for (hits &= hits - 1; hits != 0; hits &= hits - 1) {
          StackEntry other = entry_of(std::uint32_t(__builtin_ctz(hits)));
          if (other.key < next.key) std::swap(other, next);
          std::size_t place = size++;
          for (; place > bottom && stack[place - 1].key < other.key; --place) stack[place] = stack[place - 1];
          stack[place] = other;
        }
        continue;
      }
    } else {
      const Offer offer = intersect_blocks<kPrecision>(triangles, blocks + link, next.blocks, r.block,
                                                       std::min(next.exit, s_far), collector);
      if (offer == Offer::kDone) return true;
      if (offer == Offer::kNarrowed) {
        narrowed = true;
        s_far = ray.cull_far(collector.tfar());
      }
    }
    do {
      if (size == 0) return narrowed;
      next = stack[--size];
    } while (!C::kStopsAtFirst && enter_of(next.key) > s_far);
  }
}

// One function for each kernel: Highway dispatches functions, not templates.
bool kd_closest_fast(const KdLayout& t, const mesh::ObjectRay& r, ClosestHit& c) {
  return traverse<Precision::kFast>(t, r, c);
}
bool kd_closest_robust(const KdLayout& t, const mesh::ObjectRay& r, ClosestHit& c) {
  return traverse<Precision::kRobust>(t, r, c);
}
bool kd_any_fast(const KdLayout& t, const mesh::ObjectRay& r, AnyHit& c) {
  return traverse<Precision::kFast>(t, r, c);
}
bool kd_any_robust(const KdLayout& t, const mesh::ObjectRay& r, AnyHit& c) {
  return traverse<Precision::kRobust>(t, r, c);
}
bool kd_every_fast(const KdLayout& t, const mesh::ObjectRay& r, HitSink& c) {
  return traverse<Precision::kFast>(t, r, c);
}
bool kd_every_robust(const KdLayout& t, const mesh::ObjectRay& r, HitSink& c) {
  return traverse<Precision::kRobust>(t, r, c);
}
bool kd_closest_exact(const KdLayout& t, const mesh::ObjectRay& r, ExactClosest& c) {
  return traverse<Precision::kExact>(t, r, c);
}
bool kd_any_exact(const KdLayout& t, const mesh::ObjectRay& r, ExactAny& c) {
  return traverse<Precision::kExact>(t, r, c);
}

bool clip_ray(const mesh::ObjectRay& ray, const Bounds3f& box, float& enter, float& exit) {
  return clip_to_root(ray, box, enter, exit);
}
std::uint32_t enter_slots_once(const KdTreelet& treelet, const mesh::ObjectRay& ray, float s_enter,
                               float s_exit, SlotSegments& out) {
  return enter_slots(treelet, KdRay(ray), s_enter, s_exit, out);
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::blas {

HWY_EXPORT(kd_closest_fast);
HWY_EXPORT(kd_closest_robust);
HWY_EXPORT(kd_any_fast);
HWY_EXPORT(kd_any_robust);
HWY_EXPORT(kd_every_fast);
HWY_EXPORT(kd_every_robust);
HWY_EXPORT(kd_closest_exact);
HWY_EXPORT(kd_any_exact);
HWY_EXPORT(clip_ray);
HWY_EXPORT(enter_slots_once);

bool enter_kd_root(const mesh::ObjectRay& ray, const Bounds3f& box, float& enter, float& exit) {
  return HWY_DYNAMIC_DISPATCH(clip_ray)(ray, box, enter, exit);
}
std::uint32_t enter_treelet(const KdTreelet& treelet, const mesh::ObjectRay& ray, float s_enter, float s_exit,
                            SlotSegments& segments) {
  return HWY_DYNAMIC_DISPATCH(enter_slots_once)(treelet, ray, s_enter, s_exit, segments);
}

template <Precision kPrecision, Collector C>
bool KdTree::intersect(const mesh::TriangleMesh& /*mesh*/, const mesh::ObjectRay& ray, C& collector) const {
  if (layout_.treelets.empty()) return false;
  constexpr bool kFast = kPrecision == Precision::kFast;
  if constexpr (std::same_as<C, ExactClosest>) {
    return HWY_DYNAMIC_DISPATCH(kd_closest_exact)(layout_, ray, collector);
  } else if constexpr (std::same_as<C, ExactAny>) {
    return HWY_DYNAMIC_DISPATCH(kd_any_exact)(layout_, ray, collector);
  } else if constexpr (std::same_as<C, ClosestHit>) {
    if constexpr (kFast) return HWY_DYNAMIC_DISPATCH(kd_closest_fast)(layout_, ray, collector);
    return HWY_DYNAMIC_DISPATCH(kd_closest_robust)(layout_, ray, collector);
  } else if constexpr (std::same_as<C, AnyHit>) {
    if constexpr (kFast) return HWY_DYNAMIC_DISPATCH(kd_any_fast)(layout_, ray, collector);
    return HWY_DYNAMIC_DISPATCH(kd_any_robust)(layout_, ray, collector);
  } else {
    if constexpr (kFast) return HWY_DYNAMIC_DISPATCH(kd_every_fast)(layout_, ray, collector);
    return HWY_DYNAMIC_DISPATCH(kd_every_robust)(layout_, ray, collector);
  }
}

template bool KdTree::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                  ClosestHit&) const;
template bool KdTree::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                  AnyHit&) const;
template bool KdTree::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                  HitSink&) const;
template bool KdTree::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                    ClosestHit&) const;
template bool KdTree::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                    AnyHit&) const;
template bool KdTree::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                    HitSink&) const;
template bool KdTree::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                   ExactClosest&) const;
template bool KdTree::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                   ExactAny&) const;

}  // namespace gridcast::blas
#endif
