// Instances outward from a point.

#include <algorithm>
#include <vector>

#include "core/tlas/top_level.h"

namespace gridcast::tlas {
namespace {

struct Candidate {
  double distance;
  std::uint32_t instance_id;
};

/// Visits nearest first, as long as they can matter; returns the last radius.
double visit_candidates(std::vector<Candidate>& candidates, double radius, const NearVisitor& visitor) {
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.distance < b.distance || (a.distance == b.distance && a.instance_id < b.instance_id);
  });
  for (const Candidate& one : candidates) {
    if (one.distance > radius) break;
    radius = visitor.visit(visitor.object, one.instance_id);
  }
  candidates.clear();
  return radius;
}

/// Halves the box of blocks until single ones, the nearer half first, and leaves out what is too far.
///
/// An instance that reaches into several blocks is visited in one of them: the block of the cell of its range
/// that is nearest to the point, axis by axis. No point of the instance's box is nearer than that block, up
/// to the rounding that distance_below allows for, so the block is reached whenever the instance matters.
class NearSearch {
 public:
  NearSearch(const UniformGrid& grid, const BoxTable& boxes, const Vec3d& point, double radius,
             const NearVisitor& visitor)
      : grid_(grid),
        layout_(grid.layout()),
        boxes_(boxes),
        point_(point),
        radius_(radius),
        visitor_(visitor) {
    for (int axis = 0; axis < 3; ++axis) cell_[std::size_t(axis)] = layout_.cell_of(axis, point[axis]);
  }

  double run() {
    CellRange all{{0, 0, 0}, {}};
    for (std::size_t axis = 0; axis < 3; ++axis) all.upper[axis] = std::uint16_t(layout_.blocks[axis] - 1);
    descend(all);
    return radius_;
  }

 private:
  [[nodiscard]] double distance_to(const CellRange& blocks) const {
    Bounds3d bounds;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = std::size_t(axis);
      bounds.lower[axis] = layout_.plane(axis, std::int64_t(blocks.lower[a]) << layout_.shift[axis]);
      bounds.upper[axis] = layout_.plane(axis, std::int64_t(blocks.upper[a] + 1) << layout_.shift[axis]);
    }
    return distance_below(point_, bounds);
  }

  void descend(const CellRange& blocks) {
    if (distance_to(blocks) > radius_) return;
    std::size_t longest = 0;
    for (std::size_t axis = 1; axis < 3; ++axis)
      if (blocks.upper[axis] - blocks.lower[axis] > blocks.upper[longest] - blocks.lower[longest])
        longest = axis;
    if (blocks.lower[longest] == blocks.upper[longest]) {
      test_block(blocks.lower);
      return;
    }
    const int middle = (int(blocks.lower[longest]) + int(blocks.upper[longest])) / 2;
    CellRange lower = blocks, upper = blocks;
    lower.upper[longest] = std::uint16_t(middle);
    upper.lower[longest] = std::uint16_t(middle + 1);
    const bool below = (cell_[longest] >> layout_.shift[longest]) <= middle;
    descend(below ? lower : upper);
    descend(below ? upper : lower);
  }

  void test_block(const Cell& block) {
    const GridBlock* held =
        grid_.block((block[2] * layout_.blocks[1] + block[1]) * layout_.blocks[0] + block[0]);
    if (held == nullptr) return;
    for (const std::uint32_t id : held->listed()) {
      const double distance = distance_below(point_, boxes_[id].bounds);
      if (distance <= radius_ && block_to_visit_in(boxes_[id]) == block)
        candidates_.push_back({distance, id});
    }
    radius_ = visit_candidates(candidates_, radius_, visitor_);
  }

  [[nodiscard]] Cell block_to_visit_in(const InstanceBox& box) const {
    const CellRange range = layout_.range_of(box);
    Cell block;
    for (std::size_t axis = 0; axis < 3; ++axis)
      block[axis] =
          std::uint16_t(std::clamp(cell_[axis], range.lower[axis], range.upper[axis]) >> layout_.shift[axis]);
    return block;
  }

  const UniformGrid& grid_;
  const GridLayout& layout_;
  const BoxTable& boxes_;
  const Vec3d& point_;
  Cell cell_{};  ///< of the point, or the nearest to it
  double radius_;
  const NearVisitor& visitor_;
  std::vector<Candidate> candidates_;
};

}  // namespace

void TopLevel::search_all(const Vec3d& point, double radius, const NearVisitor& visitor) const {
  std::vector<Candidate> alone;
  for (const std::uint32_t id : always_) {
    const double distance = distance_below(point, boxes_[id].bounds);
    if (distance <= radius) alone.push_back({distance, id});
  }
  radius = visit_candidates(alone, radius, visitor);
  if (grid_) NearSearch(*grid_, boxes_, point, radius, visitor).run();
}

}  // namespace gridcast::tlas
