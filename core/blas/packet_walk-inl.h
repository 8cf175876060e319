// Packets through a tree of eight children a node, for whatever lays out its nodes and leaves. Included once
// per instruction set by the packet kernels (see hwy/foreach_target.h), hence the guard that toggles.
#if defined(GRIDCAST_BLAS_PACKET_WALK_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef GRIDCAST_BLAS_PACKET_WALK_INL_H_
#undef GRIDCAST_BLAS_PACKET_WALK_INL_H_
#else
#define GRIDCAST_BLAS_PACKET_WALK_INL_H_
#endif

#include <bit>
#include <limits>
#include <type_traits>

#include <hwy/highway.h>

#include "core/blas/block_filter-inl.h"
#include "core/blas/collector.h"
#include "core/blas/exact_packet.h"
#include "core/blas/packet_decide-inl.h"
#include "core/blas/packet_frame-inl.h"
#include "core/blas/packet_triangles-inl.h"
#include "core/blas/view_kernel-inl.h"
#include "core/mesh/triangle_test.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::blas::HWY_NAMESPACE {

/// One packet on its way through one tree. "Large Ray Packets for Real-time Whitted Ray Tracing", R.
/// Overbeck, 2008, has the parts: a frustum test for inner nodes, active rays at leaves; unlike the paper the
/// frustum is an interval of inverse directions, leaves test all rays of the packet at once, and what they
/// find is decided eight rays at a time or one by one.
template <Precision kPrecision, bool kAnyHit, class View>
class PacketWalk {
 public:
  using Packet = PacketOf<kPrecision>;
  using Best = BestOf<kPrecision>;

  /// `best` is for closest hits alone.
  HWY_INLINE PacketWalk(const View& tree, const Bounds3f& bounds, const Packet& packet, Best* best)
      : tree_(tree), bounds_(bounds), packet_(packet), best_(best) {}

  HWY_INLINE PacketResult run() {
    if (!set_up(packet_, bounds_, largest_drift(packet_), frame_)) return {};
    active_ = (1U << packet_.count) - 1;
    for (int axis = 0; axis < 3; ++axis) {
      const float direction = axis == 2 ? frame_.sign_z : frame_.slab[axis].inverse_low;
      const int negative = direction >= 0.F ? 0 : 1;
      near_plane_[axis] = (negative * 3 + frame_.axes[axis]) * 8;
      far_plane_[axis] = ((1 - negative) * 3 + frame_.axes[axis]) * 8;
    }
    for (std::size_t r = packet_.count; r < kLanes; ++r) switch_off(std::uint32_t(r));
    s_near_ = range_of(frame_.s_near).low;
    s_far_ = range_of(frame_.s_far).high;
    walk();
    return {true, hits_, steps_};
  }

 private:
  static constexpr bool kExact = kPrecision == Precision::kExact;
  using Node = std::remove_cvref_t<decltype(*View::nodes)>;

  /// A child to visit: s_enter of the bundle in the upper half, node * 8 + slot in the lower.
  using Entry = std::int64_t;

  static HWY_INLINE Entry entry(float s_enter, std::uint32_t place) {
    std::int32_t bits;
    __builtin_memcpy(&bits, &s_enter, 4);
    bits ^= (bits >> 31) & 0x7FFFFFFF;  // negative floats order backwards
    return (std::int64_t(bits) << 32) | std::int64_t(place);
  }

  // The stack holds what is still to visit, nearest on top. Entries of one node are inserted in order.
  HWY_INLINE void walk() {
    Entry stack[kWideStackSize];
    std::size_t size = 0;
    std::uint32_t node = 0;
    alignas(32) float s_enter[8];
    for (;;) {
      const std::size_t bottom = size;
      ++steps_;
      for (std::uint32_t hits = enter_children(tree_.nodes[node], s_enter); hits != 0; hits &= hits - 1) {
        const auto slot = std::uint32_t(__builtin_ctz(hits));
        // Any hit will do, and a leaf may have it at once; boxes that all rays start in come after it.
        const bool first = kAnyHit && wide_child::is_leaf(tree_.child(tree_.nodes[node], slot));
        const Entry child =
            entry(first ? std::numeric_limits<float>::lowest() : s_enter[slot], node * 8 + slot);
        std::size_t place = size++;
        for (; place > bottom && stack[place - 1] < child; --place) stack[place] = stack[place - 1];
        stack[place] = child;
      }
      for (;;) {
        if (size == 0) return;
        const Entry next = stack[--size];
        if (next > entry(s_far_, 0xFFFFFFFFU)) continue;
        const std::uint32_t place = std::uint32_t(next);
        const Node& parent = tree_.nodes[place / 8];
        const std::uint32_t link = tree_.child(parent, place % 8);
        if (!wide_child::is_leaf(link)) {
          node = link;
          break;
        }
        visit_leaf(parent, place % 8, link);
        if (kAnyHit && active_ == 0) return;
      }
    }
  }

  /// Slab test of the bundle with all eight slots: sets s_enter of each, returns a bit per slot that any ray
  /// may hit.
  HWY_INLINE std::uint32_t enter_children(const Node& node, float* HWY_RESTRICT s_enter) const {
    const hn::CappedTag<float, 8> d;
    std::uint32_t hits = 0;
    for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) {
      const auto sign = hn::Set(d, frame_.sign_z);
      auto enter =
          hn::Max(hn::Set(d, s_near_), hn::MulAdd(planes_of(d, node, frame_.axes[2], near_plane_[2] + i),
                                                  sign, hn::Set(d, frame_.near_z)));
      auto exit = hn::Min(
          hn::Set(d, s_far_),
          hn::MulAdd(planes_of(d, node, frame_.axes[2], far_plane_[2] + i), sign, hn::Set(d, frame_.far_z)));
      for (int axis = 0; axis < 2; ++axis) {
        if (frame_.mixed[axis]) continue;
        const PacketFrame::Slab& slab = frame_.slab[axis];
        const auto low = hn::Set(d, slab.inverse_low);
        const auto high = hn::Set(d, slab.inverse_high);
        const auto near = planes_of(d, node, frame_.axes[axis], near_plane_[axis] + i);
        const auto far = planes_of(d, node, frame_.axes[axis], far_plane_[axis] + i);
        enter = hn::Max(enter, hn::Min(hn::MulAdd(near, low, hn::Set(d, slab.near_low)),
                                       hn::MulAdd(near, high, hn::Set(d, slab.near_high))));
        exit = hn::Min(exit, hn::Max(hn::MulAdd(far, low, hn::Set(d, slab.far_low)),
                                     hn::MulAdd(far, high, hn::Set(d, slab.far_high))));
      }
      hn::Store(enter, d, s_enter + i);
      hits |= bits_of(d, hn::Le(enter, exit)) << i;
    }
    return hits & ((1U << tree_.slot_count(node)) - 1);
  }

  /// Slab test of every ray with one box.
  HWY_INLINE std::uint32_t rays_in_box(const Node& node, std::uint32_t slot) const {
    const hn::CappedTag<float, kLanes> d;
    const auto plane = [&](int axis, int place) {
      return plane_of(node, frame_.axes[axis], std::size_t(place) + slot);
    };
    const float enter_z = plane(2, near_plane_[2]) * frame_.sign_z + frame_.near_z;
    const float exit_z = plane(2, far_plane_[2]) * frame_.sign_z + frame_.far_z;
    std::uint32_t inside = 0;
    for (std::size_t i = 0; i < kLanes; i += hn::Lanes(d)) {
      auto enter = hn::Max(hn::Set(d, enter_z), hn::Load(d, frame_.s_near + i));
      auto exit = hn::Min(hn::Set(d, exit_z), hn::Load(d, frame_.s_far + i));
      for (int axis = 0; axis < 2; ++axis) {
        const auto inverse = hn::Load(d, frame_.inverse[axis] + i);
        auto near = hn::Set(d, plane(axis, near_plane_[axis]));
        auto far = hn::Set(d, plane(axis, far_plane_[axis]));
        if (frame_.mixed[axis]) {
          const auto backwards = hn::Lt(inverse, hn::Zero(d));
          const auto other = hn::IfThenElse(backwards, far, near);
          near = hn::IfThenElse(backwards, near, far);
          far = other;
        }
        enter = hn::Max(enter, hn::MulAdd(near, inverse, hn::Load(d, frame_.near_offset[axis] + i)));
        exit = hn::Min(exit, hn::MulAdd(far, inverse, hn::Load(d, frame_.far_offset[axis] + i)));
      }
      inside |= bits_of(d, hn::Le(enter, exit)) << i;
    }
    return inside;
  }

  HWY_INLINE void visit_leaf(const Node& parent, std::uint32_t slot, std::uint32_t link) {
    ++steps_;
    const std::uint32_t inside = rays_in_box(parent, slot) & active_;
    if (inside == 0) return;
    const bool alone = (inside & (inside - 1) & ((inside & (inside - 1)) - 1)) == 0;  // one ray, or two
    bool closer = false;
    for_leaf(tree_, link, [&](const TriangleBlock& block) {
      closer |= alone ? visit_block_alone(block, inside) : visit_block(block, inside);
      return true;
    });
    if (closer) s_far_ = range_of(frame_.s_far).high;
  }

  HWY_INLINE bool visit_block(const TriangleBlock& block, std::uint32_t inside) {
    BundleTriangles triangles;
    prepare_triangles<kPrecision>(block, frame_, triangles);
    bool closer = false;
    for (std::size_t lane = 0; lane < 4; ++lane) {
      // A block that is not full repeats its last triangle.
      if (lane != 0 && block.ids[lane] == block.ids[lane - 1]) break;
      std::uint32_t rays = inside & (frame_.common_origin ? filter_triangle<true>(triangles, lane, frame_)
                                                          : filter_triangle<false>(triangles, lane, frame_));
      if constexpr (kAnyHit) rays &= active_;
      if constexpr (kPrecision == Precision::kRobust)
        if (std::popcount(rays) >= kFewestAtOnce) rays = decide_many(block, lane, rays, closer);
      for (; rays != 0; rays &= rays - 1) closer |= decide(block, lane, std::uint32_t(__builtin_ctz(rays)));
    }
    return closer;
  }

  HWY_INLINE bool visit_block_alone(const TriangleBlock& block, std::uint32_t inside) {
    bool closer = false;
    for (std::uint32_t rays = inside & active_; rays != 0; rays &= rays - 1) {
      const auto r = std::uint32_t(__builtin_ctz(rays));
      std::uint32_t lanes = filter_block_alone<kPrecision>(block, frame_, r);
      for (; lanes != 0; lanes &= lanes - 1) {
        closer |= decide(block, std::size_t(__builtin_ctz(lanes)), r);
        if (kAnyHit && (active_ >> r & 1U) == 0) break;
      }
    }
    return closer;
  }

  /// Fewer rays are decided one by one.
  static constexpr int kFewestAtOnce = 3;

  /// Decides about these rays and a triangle; the rays that are left for `decide`. Sets `closer` when the
  /// s_far of a ray changed.
  HWY_INLINE std::uint32_t decide_many(const TriangleBlock& block, std::size_t lane, std::uint32_t rays,
                                       bool& closer) {
    const auto corner = [&](int number) {
      const auto& columns = block.corners[number];
      return Vec3f(columns[frame_.axes[0]][lane], columns[frame_.axes[1]][lane],
                   columns[frame_.axes[2]][lane]);
    };
    const mesh::AxesTriangle triangle(corner(0), corner(1), corner(2));
    const double mesh_size = double(bounds_.magnitude());
    const std::size_t lanes = hn::Lanes(DecideTag());
    std::uint32_t left = 0;
    for (std::size_t first = 0; first < kLanes; first += lanes) {
      const std::uint32_t asked = rays >> first & ((1U << lanes) - 1);
      if (asked == 0) continue;
      DecidedRays decided;
      intersect_many(packet_, frame_, mesh_size, triangle, first, decided);
      left |= (asked & decided.undecided) << first;
      for (std::uint32_t hits = asked & decided.hit; hits != 0; hits &= hits - 1) {
        const auto k = std::uint32_t(__builtin_ctz(hits));
        closer |= keep(block, lane, std::uint32_t(first) + k, {decided.t[k], decided.u[k], decided.v[k]});
      }
    }
    return left;
  }

  /// What a hit of the triangle test becomes. True when the ray's s_far changed.
  HWY_INLINE bool keep(const TriangleBlock& block, std::size_t lane, std::uint32_t r,
                       const mesh::TriangleHit& hit) {
    const mesh::RayEnds ends{packet_.tnear[r], packet_.instance_id, packet_.excluded_primitive[r]};
    if constexpr (kAnyHit) {
      if (!mesh::in_range(ends, hit, packet_.tfar[r], block.ids[lane])) return false;
    } else {
      if (!mesh::keep_closer(ends, hit, block.ids[lane], best_[r])) return false;
    }
    follow(block, lane, r);
    return true;
  }

  /// After ray r has a new best hit, or any.
  HWY_INLINE void follow(const TriangleBlock& block, std::size_t lane, std::uint32_t r) {
    hits_ |= 1U << r;
    if constexpr (kAnyHit) {
      switch_off(r);
    } else {
      if constexpr (!kExact) best_[r].corners_at = place_of(tree_, block, lane);
      const double s = collector_of(r).tfar() * frame_.scale[r] - frame_.shift[r];
      frame_.s_far[r] = float(s + std::abs(s) * 0x1p-22) + frame_.pad;
    }
  }

  /// What decides about a ray and a triangle that no filter rejected. True when the ray's s_far changed.
  HWY_INLINE bool decide(const TriangleBlock& block, std::size_t lane, std::uint32_t r) {
    if ((prepared_ >> r & 1U) == 0 && !prepare_ray(r)) return true;
    auto collector = collector_of(r);
    typename decltype(collector)::Candidate hit;
    if (!decide_lane<kPrecision>(block, std::uint32_t(lane), rays_[r], hit) ||
        collector.offer(rays_[r], hit, block.ids[lane]) == Offer::kGoOn)
      return false;
    follow(block, lane, r);
    return true;
  }

  HWY_INLINE auto collector_of(std::uint32_t r) const {
    if constexpr (kAnyHit && kExact)
      return ExactAny{packet_.tfar[r]};
    else if constexpr (kAnyHit)
      return AnyHit{packet_.tfar[r]};
    else if constexpr (kExact)
      return ExactClosest{best_[r]};
    else
      return ClosestHit{best_[r]};
  }

  /// The ray enters no box any more, and the bundle ends with the rays that are left.
  HWY_INLINE void switch_off(std::uint32_t r) {
    active_ &= ~(1U << r);
    frame_.s_far[r] = -std::numeric_limits<float>::infinity();
  }

  /// The deciding half of a ray, made when first needed; the same bits as ObjectRay::prepare makes. `fast`
  /// decides by the culling half too and needs all of it. False when the ray misses the mesh's box.
  HWY_INLINE bool prepare_ray(std::uint32_t r) {
    mesh::ObjectRay& ray = rays_[r];
    if constexpr (kPrecision == Precision::kFast) {
      if (!ray.prepare(packet_.ray(r), bounds_)) {
        switch_off(r);
        return false;
      }
    } else {
      ray.origin = {packet_.origin[0][r], packet_.origin[1][r], packet_.origin[2][r]};
      ray.direction = {packet_.direction[0][r], packet_.direction[1][r], packet_.direction[2][r]};
      ray.tnear = packet_.tnear[r];
      ray.shear_x = frame_.shear[0][r];
      ray.shear_y = frame_.shear[1][r];
      ray.kx = frame_.axes[0];
      ray.ky = frame_.axes[1];
      ray.kz = frame_.axes[2];
      ray.axes_origin = {packet_.origin[ray.kx][r], packet_.origin[ray.ky][r], packet_.origin[ray.kz][r]};
      ray.direction_z = packet_.direction[ray.kz][r];
      ray.distance = max_abs(ray.origin) + double(bounds_.magnitude());
      ray.side_error = 0x1p-45 * ray.distance * ray.distance;
    }
    if constexpr (kExact) {
      mesh::ExactRay& exact = exact_[r];
      exact.world = packet_.world[r];
      exact.world_from_object = packet_.world_from_object;
      exact.mesh = packet_.mesh;
      exact.attach_to(ray, packet_.image(r));
    }
    ray.instance_id = packet_.instance_id;
    ray.excluded_primitive = packet_.excluded_primitive[r];
    prepared_ |= 1U << r;
    return true;
  }

  const View tree_;
  const Bounds3f& bounds_;
  const Packet& packet_;
  Best* best_;
  PacketFrame frame_;
  int near_plane_[3];
  int far_plane_[3];
  float s_near_ = 0.F, s_far_ = 0.F;  // of the bundle
  std::uint32_t active_ = 0;
  std::uint32_t prepared_ = 0;
  std::uint32_t hits_ = 0;
  std::uint32_t steps_ = 0;
  mesh::ObjectRay rays_[kLanes];
  mesh::ExactRay exact_[kExact ? kLanes : 1];  // of `exact` alone
};

}  // namespace gridcast::blas::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
