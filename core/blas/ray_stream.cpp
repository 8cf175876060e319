// Streams through wide trees, compiled once per instruction set and chosen at run time by Highway. All of it
// only culls; the triangle test decides, so hits are those of single rays.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/blas/ray_stream.cpp"  // NOLINT: Highway includes this file once per target

#include <bit>
#include <optional>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/blas/stream_walk-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

template <Precision kPrecision, Collector C>
HWY_INLINE StreamResult walk(const WideView* trees, const mesh::ObjectRay* const* rays, C* collectors,
                             std::uint32_t count) {
  StreamWalk<kPrecision, C> walk;
  for (std::uint32_t i = 0; i < count; ++i) walk.add(trees[i], *rays[i], collectors[i]);
  return walk.run();
}

// One function for each kernel: Highway dispatches functions, not templates.
StreamResult stream_closest_fast(const WideView* t, const mesh::ObjectRay* const* r, ClosestHit* c,
                                 std::uint32_t n) {
  return walk<Precision::kFast>(t, r, c, n);
}
StreamResult stream_closest_robust(const WideView* t, const mesh::ObjectRay* const* r, ClosestHit* c,
                                   std::uint32_t n) {
  return walk<Precision::kRobust>(t, r, c, n);
}
StreamResult stream_closest_exact(const WideView* t, const mesh::ObjectRay* const* r, ExactClosest* c,
                                  std::uint32_t n) {
  return walk<Precision::kExact>(t, r, c, n);
}
StreamResult stream_any_fast(const WideView* t, const mesh::ObjectRay* const* r, AnyHit* c, std::uint32_t n) {
  return walk<Precision::kFast>(t, r, c, n);
}
StreamResult stream_any_robust(const WideView* t, const mesh::ObjectRay* const* r, AnyHit* c,
                               std::uint32_t n) {
  return walk<Precision::kRobust>(t, r, c, n);
}
StreamResult stream_any_exact(const WideView* t, const mesh::ObjectRay* const* r, ExactAny* c,
                              std::uint32_t n) {
  return walk<Precision::kExact>(t, r, c, n);
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::blas {

HWY_EXPORT(stream_closest_fast);
HWY_EXPORT(stream_closest_robust);
HWY_EXPORT(stream_closest_exact);
HWY_EXPORT(stream_any_fast);
HWY_EXPORT(stream_any_robust);
HWY_EXPORT(stream_any_exact);

namespace {

template <Precision kPrecision, bool kAnyHit>
auto collector_of(const StreamRay<kPrecision>& ray) {
  if constexpr (kPrecision == Precision::kExact) {
    if constexpr (kAnyHit)
      return ExactAny{ray.tfar};
    else
      return ExactClosest{*ray.best};
  } else {
    if constexpr (kAnyHit)
      return AnyHit{ray.tfar};
    else
      return ClosestHit{*ray.best};
  }
}

template <Precision kPrecision, bool kAnyHit>
bool trace_alone(const StreamRay<kPrecision>& ray) {
  if constexpr (kPrecision == Precision::kExact) {
    if constexpr (kAnyHit)
      return ray.blas->occluded_exact(*ray.ray, ray.tfar);
    else
      return ray.blas->intersect_exact(*ray.ray, *ray.best);
  } else {
    if constexpr (kAnyHit)
      return ray.blas->template occluded<kPrecision>(*ray.ray, ray.tfar);
    else
      return ray.blas->template intersect<kPrecision>(*ray.ray, *ray.best);
  }
}

template <Precision kPrecision, bool kAnyHit, class C>
StreamResult walk_together(const WideView* trees, const mesh::ObjectRay* const* rays, C* collectors,
                           std::uint32_t count) {
  if constexpr (kPrecision == Precision::kExact) {
    if constexpr (kAnyHit)
      return HWY_DYNAMIC_DISPATCH(stream_any_exact)(trees, rays, collectors, count);
    else
      return HWY_DYNAMIC_DISPATCH(stream_closest_exact)(trees, rays, collectors, count);
  } else if constexpr (kPrecision == Precision::kFast) {
    if constexpr (kAnyHit)
      return HWY_DYNAMIC_DISPATCH(stream_any_fast)(trees, rays, collectors, count);
    else
      return HWY_DYNAMIC_DISPATCH(stream_closest_fast)(trees, rays, collectors, count);
  } else {
    if constexpr (kAnyHit)
      return HWY_DYNAMIC_DISPATCH(stream_any_robust)(trees, rays, collectors, count);
    else
      return HWY_DYNAMIC_DISPATCH(stream_closest_robust)(trees, rays, collectors, count);
  }
}

/// Whether the ray may walk with others: through a wide tree, and in exact mode close to its world ray.
template <Precision kPrecision>
const WideBvh* tree_for(const StreamRay<kPrecision>& ray) {
  if constexpr (kPrecision == Precision::kExact)
    if (!ray.ray->exact->is_close) return nullptr;
  return ray.blas->wide_bvh();
}

/// Those without a wide tree go one by one, the others together.
template <Precision kPrecision, bool kAnyHit>
StreamResult trace_stream(std::span<const StreamRay<kPrecision>> rays) {
  using C = decltype(collector_of<kPrecision, kAnyHit>(rays[0]));
  WideView trees[kStreamSize];
  const mesh::ObjectRay* object_rays[kStreamSize];
  std::uint32_t places[kStreamSize];
  alignas(C) std::byte memory[kStreamSize * sizeof(C)];
  StreamResult result;
  std::uint32_t count = 0;
  for (std::uint32_t i = 0; i < rays.size(); ++i) {
    const WideBvh* tree = tree_for(rays[i]);
    if (tree == nullptr) {
      result.hits |= std::uint32_t(trace_alone<kPrecision, kAnyHit>(rays[i])) << i;
      continue;
    }
    trees[count] = view_of(*tree);
    object_rays[count] = rays[i].ray;
    new (memory + count * sizeof(C)) C(collector_of<kPrecision, kAnyHit>(rays[i]));
    places[count++] = i;
  }
  if (count == 0) return result;
  auto* collectors = std::launder(static_cast<C*>(static_cast<void*>(memory)));
  const StreamResult walked = walk_together<kPrecision, kAnyHit>(trees, object_rays, collectors, count);
  for (std::uint32_t bits = walked.hits; bits != 0; bits &= bits - 1)
    result.hits |= 1U << places[std::countr_zero(bits)];
  result.steps = walked.steps;
  return result;
}

}  // namespace

template <Precision kPrecision>
StreamResult intersect_stream(std::span<const StreamRay<kPrecision>> rays) {
  return trace_stream<kPrecision, false>(rays);
}
template <Precision kPrecision>
StreamResult occluded_stream(std::span<const StreamRay<kPrecision>> rays) {
  return trace_stream<kPrecision, true>(rays);
}

template StreamResult intersect_stream(std::span<const StreamRay<Precision::kFast>>);
template StreamResult intersect_stream(std::span<const StreamRay<Precision::kRobust>>);
template StreamResult intersect_stream(std::span<const StreamRay<Precision::kExact>>);
template StreamResult occluded_stream(std::span<const StreamRay<Precision::kFast>>);
template StreamResult occluded_stream(std::span<const StreamRay<Precision::kRobust>>);
template StreamResult occluded_stream(std::span<const StreamRay<Precision::kExact>>);

}  // namespace gridcast::blas
#endif  // HWY_ONCE
