#include "core/blas/kd_tree.h"
#include "core/mesh/triangle_test.h"

namespace gridcast::blas {
namespace {

/// The part of the ray inside a cell, padded, in the culling half's s.
struct Segment {
  float enter, exit;
};

struct StackEntry {
  std::uint32_t node;
  Segment segment;
};

/// mesh::intersect_box with the far end as well.
bool clip_to_root(const mesh::ObjectRay& ray, const Bounds3f& box, float s_far, Segment& segment) {
  if (!mesh::intersect_box(ray, box.lower, box.upper, s_far, segment.enter)) return false;
  segment.exit = s_far;
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = ray.inverse_direction[axis];
    const float far_plane = inverse >= 0.F ? box.upper[axis] : box.lower[axis];
    segment.exit = std::min(segment.exit, far_plane * inverse + ray.far_offset[axis]);
  }
  return true;
}

}  // namespace

// Front to back with a stack. A plane is met not at one s but within [lower, upper], which holds the s of
// every hit whose triangle has its point in the plane: such hits belong to both sides, those in the near cell
// lie at upper or before, those in the far cell at lower or after. Because every point of a triangle lies in
// a leaf that lists it, the leaf of the winning hit is reached whatever the rounding. Every inner node on the
// way down leaves at most one entry, and the depth is bounded.
template <Precision kPrecision, bool kAnyHit>
bool KdTree::intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, Hit& best) const {
  if (data_.nodes.empty()) return false;
  const KdNode* const nodes = data_.nodes.data();
  const std::uint32_t* const references = data_.references.data();
  float s_far = ray.cull_far(best.t);
  Segment segment;
  if (!clip_to_root(ray, data_.bounds, s_far, segment)) return false;

  StackEntry stack[kMaxKdDepth];
  std::size_t stack_size = 0;
  bool replaced = false;
  std::uint32_t index = 0;
  for (;;) {
    while (!nodes[index].is_leaf()) {
      const KdNode node = nodes[index];
      const int axis = node.axis();
      const float inverse = ray.inverse_direction[axis];
      const float at_plane = node.plane() * inverse;
      const float lower = at_plane + ray.near_offset[axis];
      const float upper = at_plane + ray.far_offset[axis];
      const std::uint32_t near = inverse >= 0.F ? index + 1 : node.second_child();
      const std::uint32_t far = inverse >= 0.F ? node.second_child() : index + 1;
      if (segment.exit < lower) {
        index = near;
      } else if (segment.enter > upper) {
        index = far;
      } else {
        stack[stack_size++] = {far, {std::max(segment.enter, lower), segment.exit}};
        segment.exit = std::min(segment.exit, upper);
        index = near;
      }
    }

    const KdNode leaf = nodes[index];
    bool closer_here = false;
    for (std::uint32_t i = leaf.first(); i < leaf.first() + leaf.count(); ++i) {
      const std::uint32_t id = references[i];
      const auto [p0, p1, p2] = mesh.corners(id);
      if (!mesh::intersect_primitive<kPrecision>(ray, p0, p1, p2, id, best)) continue;
      if constexpr (kAnyHit) return true;
      closer_here = true;
    }
    if (closer_here) {
      replaced = true;
      s_far = ray.cull_far(best.t);
    }
    do {
      if (stack_size == 0) return replaced;
      --stack_size;
    } while (stack[stack_size].segment.enter > s_far);
    index = stack[stack_size].node;
    segment = {stack[stack_size].segment.enter, std::min(stack[stack_size].segment.exit, s_far)};
  }
}

template bool KdTree::intersect<Precision::kFast, false>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                         Hit&) const;
template bool KdTree::intersect<Precision::kFast, true>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        Hit&) const;
template bool KdTree::intersect<Precision::kRobust, false>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                           Hit&) const;
template bool KdTree::intersect<Precision::kRobust, true>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                          Hit&) const;

}  // namespace gridcast::blas
