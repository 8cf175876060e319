// Rays that start so far away that rounding may carry their hits out of the cells of an instance.

#include "core/tlas/uniform_grid.h"

namespace gridcast::tlas {
namespace {

/// Halves the box of blocks until single ones, keeping those that the ray may pass. `pad` is the room that
/// the ray's distance asks for by the largest drift of any box.
///
/// An instance that reaches into several blocks is tested in one of them. With p the point where the ray
/// comes into its box (grown by its own pad, as tested), the cell of p, moved to the nearest one of the
/// instance's range, is in that block: a choice that depends on nothing but ray and box. The block is
/// reached, since on each axis p is either in it or at most the instance's pad from the box, thus from the
/// range and the block, up to the rounding of p, of the index and of the slab test, each less than
/// rounding_slack.
class Search {
 public:
  Search(const UniformGrid& grid, const BoxTable& boxes, const WorldRay& ray, double pad,
         const InstanceVisitor& visitor)
      : grid_(grid), layout_(grid.layout()), boxes_(boxes), ray_(ray), pad_(pad), visitor_(visitor) {}

  double run(double far) {
    far_ = far;
    CellRange all{{0, 0, 0}, {}};
    for (std::size_t axis = 0; axis < 3; ++axis) all.upper[axis] = std::uint16_t(layout_.blocks[axis] - 1);
    descend(all);
    return far_;
  }

 private:
  void descend(const CellRange& blocks) {
    Bounds3d bounds;
    int longest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = std::size_t(axis);
      bounds.lower[axis] = layout_.plane(axis, std::int64_t(blocks.lower[a]) << layout_.shift[axis]);
      bounds.upper[axis] = layout_.plane(axis, std::int64_t(blocks.upper[a] + 1) << layout_.shift[axis]);
      const auto l = std::size_t(longest);
      if (blocks.upper[a] - blocks.lower[a] > blocks.upper[l] - blocks.lower[l]) longest = axis;
    }
    if (intersect_box(ray_, bounds, pad_, far_).empty()) return;
    const auto axis = std::size_t(longest);
    if (blocks.lower[axis] == blocks.upper[axis]) {
      test_block(blocks.lower);
      return;
    }
    const int middle = (int(blocks.lower[axis]) + int(blocks.upper[axis])) / 2;
    CellRange lower = blocks, upper = blocks;
    lower.upper[axis] = std::uint16_t(middle);
    upper.lower[axis] = std::uint16_t(middle + 1);
    const bool forward = ray_.direction[longest] >= 0.0;
    descend(forward ? lower : upper);
    descend(forward ? upper : lower);
  }

  void test_block(const Cell& block) {
    const GridBlock* held =
        grid_.block((block[2] * layout_.blocks[1] + block[1]) * layout_.blocks[0] + block[0]);
    if (held == nullptr) return;
    for (const std::uint32_t id : held->listed()) {
      const InstanceBox& box = boxes_[id];
      const Span span = intersect_alone(ray_, box, far_);
      if (!span.empty() && block_to_test_in(box, span.enter) == block)
        far_ = visitor_.visit(visitor_.object, id);
    }
  }

  [[nodiscard]] Cell block_to_test_in(const InstanceBox& box, double t_enter) const {
    const CellRange range = layout_.range_of(box);
    Cell block;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = std::size_t(axis);
      const std::uint16_t cell = layout_.cell_of(axis, ray_.origin[axis] + t_enter * ray_.direction[axis]);
      block[a] = std::uint16_t(std::clamp(cell, range.lower[a], range.upper[a]) >> layout_.shift[axis]);
    }
    return block;
  }

  const UniformGrid& grid_;
  const GridLayout& layout_;
  const BoxTable& boxes_;
  const WorldRay& ray_;
  double pad_;
  const InstanceVisitor& visitor_;
  double far_ = 0.0;
};

}  // namespace

double UniformGrid::search(const WorldRay& ray, double far, const BoxTable& boxes,
                           const InstanceVisitor& visitor) const {
  const double distance = ray.distance_to(layout_.bounds);
  // Three roundings as above, and those of the test of a box alone.
  const double pad = double(max_drift_) * distance + 4.0 * rounding_slack(distance, layout_.bounds);
  return Search(*this, boxes, ray, pad, visitor).run(far);
}

}  // namespace gridcast::tlas
