// MeshHull::reach of several rows at once, one in each lane, bit for bit, with every instruction set: the
// same operations in the same order, none of them fused. Included once per instruction set (see
// hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_SCENE_HULL_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_SCENE_HULL_LANES_INL_H
#undef GRIDCAST_SCENE_HULL_LANES_INL_H
#else
#define GRIDCAST_SCENE_HULL_LANES_INL_H
#endif

#include <cstddef>
#include <cstdint>

#include <hwy/highway.h>

#include "core/math/transform_lanes-inl.h"
#include "core/scene/mesh_hull.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::scene::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using gridcast::HWY_NAMESPACE::TransformLanes;
using D = TransformLanes::D;
using V = TransformLanes::V;

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
    alignas(64) double values[TransformLanes::kSize];
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
    alignas(64) double values[TransformLanes::kSize];
    hn::Store(numbers, d, values);
    for (std::size_t k = 0; k < hn::Lanes(d); ++k) values[k] = double(hulls_[k]->along(int(values[k])));
    return hn::Load(d, values);
  }

  const MeshHull* const* hulls_;
};

}  // namespace gridcast::scene::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
