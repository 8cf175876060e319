#include "core/blas/wide_steps.h"

#include <array>

namespace gridcast::blas {
namespace {

using Enters = std::array<float, 8>;

/// A bit for every slot whose box the ray enters in [0, s_far], and where it does. Written so that compilers
/// make vectors of the loops over the slots.
std::uint32_t enter_children(const WideNode& node, const mesh::ObjectRay& ray, float s_far, Enters& enter) {
  Enters exit;
  enter.fill(0.F);
  exit.fill(s_far);
  for (int axis = 0; axis < 3; ++axis) {
    const float inverse = ray.inverse_direction[axis];
    const float near_offset = ray.near_offset[axis], far_offset = ray.far_offset[axis];
    const int lower_is_near = inverse >= 0.F ? 1 : 0;
    const float* const near_planes = node.planes[1 - lower_is_near][axis];
    const float* const far_planes = node.planes[lower_is_near][axis];
    for (std::size_t slot = 0; slot < 8; ++slot) {
      const float entry = near_planes[slot] * inverse + near_offset;
      enter[slot] = entry > enter[slot] ? entry : enter[slot];
      const float end = far_planes[slot] * inverse + far_offset;
      exit[slot] = end < exit[slot] ? end : exit[slot];
    }
  }
  std::uint32_t entered = 0;
  for (std::uint32_t slot = 0; slot < node.slots; ++slot)
    entered |= std::uint32_t(enter[slot] <= exit[slot]) << slot;
  return entered;
}

struct StackEntry {
  float s_enter;
  std::uint32_t link;
};

/// What is still to visit, nearest on top.
class Stack {
 public:
  /// The children of one node, in order.
  void push(const WideNode& node, std::uint32_t entered, const Enters& enter) {
    const std::size_t bottom = size_;
    for (; entered != 0; entered &= entered - 1) {
      const auto slot = std::uint32_t(__builtin_ctz(entered));
      std::size_t place = size_++;
      for (; place > bottom && entries_[place - 1].s_enter < enter[slot]; --place)
        entries_[place] = entries_[place - 1];
      entries_[place] = {enter[slot], node.child[slot]};
    }
  }
  /// False when nothing is left that is entered at s_far or before.
  bool pop(float s_far, std::uint32_t& link) {
    while (size_ > 0) {
      const StackEntry& top = entries_[--size_];
      if (top.s_enter > s_far) continue;
      link = top.link;
      return true;
    }
    return false;
  }

 private:
  std::array<StackEntry, kWideStackSize + 1> entries_;  // one more: the kernels keep the nearest elsewhere
  std::size_t size_ = 0;
};

/// True when `best` was replaced. A block that is not full repeats a triangle, which changes nothing.
bool test_block(const TriangleBlock& block, const mesh::ObjectRay& ray, Hit& best) {
  bool replaced = false;
  for (std::size_t lane = 0; lane < 4; ++lane) {
    replaced |= mesh::intersect_primitive<Precision::kFast>(ray, block.corner(0, lane), block.corner(1, lane),
                                                            block.corner(2, lane), block.ids[lane], best);
  }
  return replaced;
}

/// In [-1, 1). "Fast splittable pseudorandom number generators", G. L. Steele, 2014: its mixing function.
double next_uniform(std::uint64_t& state) {
  std::uint64_t z = (state += 0x9E3779B97F4A7C15U);
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
  return double((z ^ (z >> 31U)) >> 11U) * 0x1p-52 - 1.0;
}

Vec3d next_in_cube(std::uint64_t& state) {
  const double x = next_uniform(state), y = next_uniform(state), z = next_uniform(state);
  return {x, y, z};
}

}  // namespace

WideSteps steps_to_closest(const WideNodes& nodes, const TriangleBlocks& blocks, const mesh::ObjectRay& ray,
                           Hit& best) {
  WideSteps steps;
  if (nodes.empty()) return steps;
  Stack stack;
  Enters enter;
  float s_far = ray.cull_far(best.t);
  std::uint32_t link = 0;
  do {
    if (!wide_child::is_leaf(link)) {
      ++steps.nodes;
      stack.push(nodes[link], enter_children(nodes[link], ray, s_far, enter), enter);
      continue;
    }
    const std::uint32_t first = wide_child::index(link), count = wide_child::block_count(link);
    steps.blocks += count;
    bool replaced = false;
    for (std::uint32_t block = first; block < first + count; ++block)
      replaced |= test_block(blocks[block], ray, best);
    if (replaced) s_far = ray.cull_far(best.t);
  } while (stack.pop(s_far, link));
  return steps;
}

Result<double> steps_per_ray(const WideNodes& nodes, const TriangleBlocks& blocks, const Bounds3f& bounds,
                             std::size_t rays, const std::stop_token& stop) {
  if (nodes.empty() || bounds.empty() || rays == 0) return 0.0;
  const Bounds3d box = to_double(bounds);
  const Vec3d center = box.center(), half = 0.5 * box.extent();
  std::uint64_t state = 20, steps = 0;
  for (std::size_t i = 0; i < rays; ++i) {
    if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "counting steps was cancelled", ""};
    // From outside of the box to somewhere in it.
    const Vec3d side = next_in_cube(state);
    const Vec3d from = side * (1.5 / max_abs(side)), to = next_in_cube(state);
    const Ray ray{center + from * half, (to - from) * half};
    if (!is_valid(ray)) return 0.0;
    mesh::ObjectRay prepared;
    if (!prepared.prepare(ray, bounds)) continue;
    Hit best{ray.tfar};
    const WideSteps met = steps_to_closest(nodes, blocks, prepared, best);
    steps += met.nodes + met.blocks;
  }
  return double(steps) / double(rays);
}

}  // namespace gridcast::blas
