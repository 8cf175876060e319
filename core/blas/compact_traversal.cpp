// The traversal kernel, compiled once per instruction set and chosen at run time by Highway.
// All of it only culls; mesh::intersect_triangle decides, in scalar double, so hits are the same on each.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/blas/compact_traversal.cpp"  // NOLINT: Highway includes this file once per target

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/blas/compact_bvh.h"
#include "core/blas/kernel_steps.h"
#include "core/blas/wide_kernel-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

// One function for each kernel: Highway dispatches functions, not templates.
bool closest_fast(const CompactView& tree, const mesh::ObjectRay& r, ClosestHit& c) {
  return traverse<Precision::kFast>(tree, r, c);
}
bool closest_robust(const CompactView& tree, const mesh::ObjectRay& r, ClosestHit& c) {
  return traverse<Precision::kRobust>(tree, r, c);
}
bool any_fast(const CompactView& tree, const mesh::ObjectRay& r, AnyHit& c) {
  return traverse<Precision::kFast>(tree, r, c);
}
bool any_robust(const CompactView& tree, const mesh::ObjectRay& r, AnyHit& c) {
  return traverse<Precision::kRobust>(tree, r, c);
}
bool every_fast(const CompactView& tree, const mesh::ObjectRay& r, HitSink& c) {
  return traverse<Precision::kFast>(tree, r, c);
}
bool every_robust(const CompactView& tree, const mesh::ObjectRay& r, HitSink& c) {
  return traverse<Precision::kRobust>(tree, r, c);
}
bool closest_exact(const CompactView& tree, const mesh::ObjectRay& r, ExactClosest& c) {
  return traverse<Precision::kExact>(tree, r, c);
}
bool any_exact(const CompactView& tree, const mesh::ObjectRay& r, ExactAny& c) {
  return traverse<Precision::kExact>(tree, r, c);
}

std::uint32_t enter_node(const CompactNode& node, const mesh::ObjectRay& ray, float s_far, SlotEntries& out) {
  return enter_children(node, WideRay(ray), s_far, out.s_enter_bits);
}

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::blas {

HWY_EXPORT(closest_fast);
HWY_EXPORT(closest_robust);
HWY_EXPORT(any_fast);
HWY_EXPORT(any_robust);
HWY_EXPORT(every_fast);
HWY_EXPORT(every_robust);
HWY_EXPORT(closest_exact);
HWY_EXPORT(any_exact);
HWY_EXPORT(enter_node);

std::uint32_t enter_node(const CompactNode& node, const mesh::ObjectRay& ray, float s_far,
                         SlotEntries& entries) {
  return HWY_DYNAMIC_DISPATCH(enter_node)(node, ray, s_far, entries);
}

template <Precision kPrecision, Collector C>
bool CompactBvh::intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const {
  if (nodes().empty()) return false;
  const CompactView tree = view(mesh);
  constexpr bool kFast = kPrecision == Precision::kFast;
  if constexpr (std::same_as<C, ExactClosest>) {
    return HWY_DYNAMIC_DISPATCH(closest_exact)(tree, ray, collector);
  } else if constexpr (std::same_as<C, ExactAny>) {
    return HWY_DYNAMIC_DISPATCH(any_exact)(tree, ray, collector);
  } else if constexpr (std::same_as<C, ClosestHit>) {
    if constexpr (kFast) return HWY_DYNAMIC_DISPATCH(closest_fast)(tree, ray, collector);
    return HWY_DYNAMIC_DISPATCH(closest_robust)(tree, ray, collector);
  } else if constexpr (std::same_as<C, AnyHit>) {
    if constexpr (kFast) return HWY_DYNAMIC_DISPATCH(any_fast)(tree, ray, collector);
    return HWY_DYNAMIC_DISPATCH(any_robust)(tree, ray, collector);
  } else {
    if constexpr (kFast) return HWY_DYNAMIC_DISPATCH(every_fast)(tree, ray, collector);
    return HWY_DYNAMIC_DISPATCH(every_robust)(tree, ray, collector);
  }
}

template bool CompactBvh::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                      ClosestHit&) const;
template bool CompactBvh::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                      AnyHit&) const;
template bool CompactBvh::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                      HitSink&) const;
template bool CompactBvh::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        ClosestHit&) const;
template bool CompactBvh::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        AnyHit&) const;
template bool CompactBvh::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        HitSink&) const;
template bool CompactBvh::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                       ExactClosest&) const;
template bool CompactBvh::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                       ExactAny&) const;

}  // namespace gridcast::blas
#endif
