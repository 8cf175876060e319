// Compiled once per instruction set and chosen at run time by Highway. hit_box.cpp says why the boxes are
// right; here are the same operations in the same order, none of them fused.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/scene/place_batch.cpp"  // NOLINT: Highway includes this file once per target

#include "core/scene/place_batch.h"

#include <array>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/math/transform_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::scene::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using gridcast::HWY_NAMESPACE::Four;
using gridcast::HWY_NAMESPACE::store_rows;
using gridcast::HWY_NAMESPACE::TransformLanes;
using D = TransformLanes::D;
using V = TransformLanes::V;
constexpr std::size_t kSize = PlaceBatch::kSize;
constexpr std::size_t kLanes = TransformLanes::kSize;

/// How far the meshes reach along a row of their matrices.
struct Reaches {
  V backward, forward;
};

HWY_INLINE Reaches weighted_sum(const V (&factors)[3], const Reaches (&along)[3]) {
  Reaches sum{factors[0] * along[0].backward, factors[0] * along[0].forward};
  for (int k = 1; k < 3; ++k) {
    sum.backward = sum.backward + factors[k] * along[k].backward;
    sum.forward = sum.forward + factors[k] * along[k].forward;
  }
  return sum;
}

/// MeshHull::reach. The numbers of directions are small integers, here in doubles.
template <class Hulls>
HWY_INLINE Reaches reach_by_numbers(const V (&n)[3], const Hulls& hulls) {
  const D d;
  V size[3], step[3];
  for (int axis = 0; axis < 3; ++axis) {
    const V number = hn::Set(d, axis == 0 ? 1.0 : (axis == 1 ? 3.0 : 9.0));
    size[axis] = hn::Abs(n[axis]);
    step[axis] = hn::IfThenElse(hn::Lt(n[axis], hn::Zero(d)), hn::Neg(number), number);
  }
  const auto order = [&](int a, int b) HWY_ATTR {
    const auto swap = hn::Lt(size[a], size[b]);
    const V larger = hn::IfThenElse(swap, size[b], size[a]), smaller = hn::IfThenElse(swap, size[a], size[b]);
    const V first = hn::IfThenElse(swap, step[b], step[a]), second = hn::IfThenElse(swap, step[a], step[b]);
    size[a] = larger;
    size[b] = smaller;
    step[a] = first;
    step[b] = second;
  };
  order(0, 1);
  order(1, 2);
  order(0, 1);
  const V edge = step[0] + step[1];
  return weighted_sum({size[0] - size[1], size[1] - size[2], size[2]},
                      {hulls.along(step[0]), hulls.along(edge), hulls.along(edge + step[2])});
}

/// The reaches of a mesh along directions and against them.
#if HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX3
class OneHull {
 public:
  // All of them in two registers.
  HWY_INLINE explicit OneHull(const MeshHull& hull)
      : magnitude_(double(hull.magnitude())),
        first_(_mm512_loadu_ps(hull.numbered() - MeshHull::kLargestNumber)),
        second_(_mm512_maskz_loadu_ps(kRest, hull.numbered() - MeshHull::kLargestNumber + 16)) {}
  [[nodiscard]] HWY_INLINE V magnitude() const { return hn::Set(D(), magnitude_); }
  [[nodiscard]] HWY_INLINE Reaches reach(const V (&n)[3]) const { return reach_by_numbers(n, *this); }
  [[nodiscard]] HWY_INLINE Reaches along(V numbers) const {
    const __m256i forward = _mm512_cvttpd_epi32((numbers + hn::Set(D(), MeshHull::kLargestNumber)).raw);
    const __m256i backward = _mm256_sub_epi32(_mm256_set1_epi32(2 * MeshHull::kLargestNumber), forward);
    return {found(backward), found(forward)};
  }

 private:
  [[nodiscard]] HWY_INLINE V found(__m256i places) const {
    const __m512 found = _mm512_permutex2var_ps(first_, _mm512_castsi256_si512(places), second_);
    return V{_mm512_cvtps_pd(_mm512_castps512_ps256(found))};
  }

  static constexpr __mmask16 kRest = (1U << (MeshHull::kNumbers - 16)) - 1U;
  double magnitude_;
  __m512 first_, second_;
};
#elif HWY_ARCH_X86 && HWY_TARGET <= HWY_AVX2
/// By signs, since a gather takes longer than to look in seven registers.
class OneHull {
 public:
  HWY_INLINE explicit OneHull(const MeshHull& hull) : magnitude_(double(hull.magnitude())) {
    const MeshHull::BySigns& by_signs = hull.by_signs();
    for (int axis = 0; axis < 3; ++axis) {
      faces_[axis] = _mm256_loadu_ps(by_signs.faces[axis].data());
      edges_[axis] = _mm256_loadu_ps(by_signs.edges[axis].data());
    }
    corners_ = _mm256_loadu_ps(by_signs.corners.data());
  }
  [[nodiscard]] HWY_INLINE V magnitude() const { return hn::Set(D(), magnitude_); }
  /// MeshHull::reach. Among components of the same size another one may count as the larger: what is looked
  /// up for it counts nothing.
  [[nodiscard]] HWY_INLINE Reaches reach(const V (&n)[3]) const {
    const V x = hn::Abs(n[0]), y = hn::Abs(n[1]), z = hn::Abs(n[2]);
    const V larger = hn::Max(x, y), smaller = hn::Min(x, y);
    const V most = hn::Max(larger, z), least = hn::Min(smaller, z),
            middle = hn::Max(smaller, hn::Min(larger, z));
    const __m256i signs = signs_of(n);
    const auto in = [&](__m256 table) HWY_ATTR { return _mm256_permutevar8x32_ps(table, signs); };
    const auto is_less = [](V a, V b)
                             HWY_ATTR { return _mm256_castpd_ps(_mm256_cmp_pd(a.raw, b.raw, _CMP_LT_OQ)); };
    const __m256 y_is_larger = is_less(x, y);
    const __m256 face = _mm256_blendv_ps(_mm256_blendv_ps(in(faces_[0]), in(faces_[1]), y_is_larger),
                                         in(faces_[2]), is_less(larger, z));
    const __m256 edge = _mm256_blendv_ps(_mm256_blendv_ps(in(edges_[1]), in(edges_[0]), y_is_larger),
                                         in(edges_[2]), is_less(z, smaller));
    return weighted_sum({most - middle, middle - least, least},
                        {apart(face), apart(edge), apart(in(corners_))});
  }

 private:
  /// The index of each lane's signs in the lower half of the lane and that of the opposite ones in the upper.
  static HWY_INLINE __m256i signs_of(const V (&n)[3]) {
    const auto bit = [&](int axis) HWY_ATTR {
      const __m256d forth = _mm256_castsi256_pd(_mm256_set1_epi64x(std::int64_t(1) << (32 + axis)));
      const __m256d back = _mm256_castsi256_pd(_mm256_set1_epi64x(std::int64_t(1) << axis));
      return _mm256_castpd_si256(_mm256_blendv_pd(forth, back, n[axis].raw));
    };
    return _mm256_or_si256(_mm256_or_si256(bit(0), bit(1)), bit(2));
  }
  static HWY_INLINE Reaches apart(__m256 pairs) {
    const __m256 apart = _mm256_permutevar8x32_ps(pairs, _mm256_setr_epi32(0, 2, 4, 6, 1, 3, 5, 7));
    return {V{_mm256_cvtps_pd(_mm256_extractf128_ps(apart, 1))},
            V{_mm256_cvtps_pd(_mm256_castps256_ps128(apart))}};
  }

  double magnitude_;
  __m256 faces_[3], edges_[3], corners_;
};
#else
class OneHull {
 public:
  HWY_INLINE explicit OneHull(const MeshHull& hull)
      : magnitude_(double(hull.magnitude())), numbered_(hull.numbered()) {}
  [[nodiscard]] HWY_INLINE V magnitude() const { return hn::Set(D(), magnitude_); }
  [[nodiscard]] HWY_INLINE Reaches reach(const V (&n)[3]) const { return reach_by_numbers(n, *this); }
  [[nodiscard]] HWY_INLINE Reaches along(V numbers) const {
    return {found(hn::Neg(numbers)), found(numbers)};
  }

 private:
  [[nodiscard]] HWY_INLINE V found(V numbers) const {
    const hn::Rebind<float, D> f;
    const hn::Rebind<std::int32_t, D> i;
    return hn::PromoteTo(D(), hn::GatherIndex(f, numbered_, hn::DemoteTo(i, numbers)));
  }

  double magnitude_;
  const float* numbered_;
};
#endif

/// Those of each lane's mesh.
class HullOfEachLane {
 public:
  HWY_INLINE explicit HullOfEachLane(const MeshHull* const* hulls) : hulls_(hulls) {}
  [[nodiscard]] HWY_INLINE V magnitude() const {
    const D d;
    alignas(64) double values[kSize];
    for (std::size_t k = 0; k < hn::Lanes(d); ++k) values[k] = double(hulls_[k]->magnitude());
    return hn::Load(d, values);
  }
  [[nodiscard]] HWY_INLINE Reaches reach(const V (&n)[3]) const { return reach_by_numbers(n, *this); }
  [[nodiscard]] HWY_INLINE Reaches along(V numbers) const {
    return {found(hn::Neg(numbers)), found(numbers)};
  }

 private:
  [[nodiscard]] HWY_INLINE V found(V numbers) const {
    const D d;
    alignas(64) double values[kSize];
    hn::Store(numbers, d, values);
    for (std::size_t k = 0; k < hn::Lanes(d); ++k) values[k] = double(hulls_[k]->along(int(values[k])));
    return hn::Load(d, values);
  }

  const MeshHull* const* hulls_;
};

HWY_INLINE V largest_of(V a, V b, V c) {
  return hn::Max(hn::Max(a, b), c);
}

HWY_INLINE V round_to_float(V x) {
  const D d;
  const hn::Rebind<float, D> f;
  return hn::PromoteTo(d, hn::DemoteTo(f, x));
}

/// A box as the seven numbers that it takes in memory; the last is `drift` and padding.
static_assert(sizeof(tlas::InstanceBox) == 7 * sizeof(double) &&
              offsetof(tlas::InstanceBox, drift) == 6 * sizeof(double));
using BoxRows = std::array<double*, kLanes>;

HWY_INLINE void store_boxes(const V (&lower)[3], const V (&upper)[3], V drift, BoxRows rows) {
  const D d;
  const hn::Rebind<float, D> f;
  const hn::Rebind<std::uint32_t, D> u32;
  const hn::Rebind<std::uint64_t, D> u64;
  const V last = hn::BitCast(d, hn::PromoteTo(u64, hn::BitCast(u32, hn::DemoteTo(f, drift))));
  store_rows(d, Four<D>{{lower[0], lower[1], lower[2], upper[0]}}, rows);
  // One of these once more: a whole row is one store.
  for (double*& row : rows) row += 3;
  store_rows(d, Four<D>{{upper[0], upper[1], upper[2], last}}, rows);
}

template <class Hulls>
HWY_INLINE void write_boxes(const TransformLanes& lanes, const Hulls& hulls, const BoxRows& rows) {
  const D d;
  const V size = hulls.magnitude();
  const V growth = hn::Set(d, 0x1p-17) * size + hn::Set(d, 0x1p-98);
  V lower[3], upper[3], lengths[3], reaches[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const V n[3] = {lanes.linear()[0][axis], lanes.linear()[1][axis], lanes.linear()[2][axis]};
    const V length = hn::Abs(n[0]) + hn::Abs(n[1]) + hn::Abs(n[2]);
    const V t = lanes.translation()[axis];
    const V room = length * growth + hn::Set(d, 0x1p-50) * (length * size + hn::Abs(t));
    const Reaches reached = hulls.reach(n);
    lower[axis] = t - (reached.backward + room);
    upper[axis] = t + (reached.forward + room);
    reaches[axis] = hn::Max(hn::Abs(lower[axis] - t), hn::Abs(upper[axis] - t));
    lengths[axis] = length;
  }
  const V stretch = largest_of(lengths[0], lengths[1], lengths[2]) * lanes.inverse_norm();
  const V exact_drift = hn::Set(d, 0x1p-40) * stretch + hn::Set(d, 4.0) * lanes.round_trip_error();
  const V drift = round_to_float(exact_drift * hn::Set(d, 1.0 + 0x1p-22));
  const V outward = drift * largest_of(reaches[0], reaches[1], reaches[2]) * hn::Set(d, 1.0 + 0x1p-40);
  V magnitude = hn::Zero(d);
  for (std::size_t axis = 0; axis < 3; ++axis)
    magnitude = hn::Max(magnitude, hn::Max(hn::Abs(lower[axis]), hn::Abs(upper[axis])));
  const V room = outward + hn::Set(d, 0x1p-52) * (magnitude + outward);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    lower[axis] = lower[axis] - room;
    upper[axis] = upper[axis] + room;
  }
  store_boxes(lower, upper, drift, rows);
}

std::uint32_t place(const PlaceBatch::Lanes& batch) {
  std::uint32_t active = 0;
  for (std::size_t first = 0; first < kSize; first += kLanes) {
    std::array<const double*, kLanes> from;
    std::array<double*, kLanes> to;
    BoxRows boxes;
    for (std::size_t k = 0; k < kLanes; ++k) {
      from[k] = TransformRows::of(*batch.from[first + k]);
      to[k] = TransformRows::of(*batch.transforms[first + k]);
      void* const box = batch.boxes[first + k];
      boxes[k] = static_cast<double*>(box);
    }
    const TransformLanes lanes(from);
    lanes.store(to);
    if (batch.one_hull) {
      write_boxes(lanes, OneHull(*batch.hulls[0]), boxes);
    } else {
      write_boxes(lanes, HullOfEachLane(batch.hulls.data() + first), boxes);
    }
    active |= lanes.active() << first;
  }
  return active;
}

}  // namespace gridcast::scene::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::scene {

HWY_EXPORT(place);

std::uint32_t PlaceBatch::place() {
  for (std::size_t k = count_; k < kSize; ++k) {
    from_[k] = &spare_.from;
    hulls_[k] = hulls_[0];
    transforms_[k] = &spare_.transform;
    boxes_[k] = &spare_.box;
  }
  const std::uint32_t active = HWY_DYNAMIC_DISPATCH(place)({from_, hulls_, transforms_, boxes_, one_hull_});
  if (!one_hull_ || hulls_[0]->empty())
    for (std::size_t k = 0; k < count_; ++k)
      if (hulls_[k]->empty()) *boxes_[k] = {};
  return active & ((1U << count_) - 1U);
}

}  // namespace gridcast::scene
#endif
