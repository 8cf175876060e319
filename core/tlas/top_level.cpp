#include "core/tlas/top_level.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <tbb/parallel_for.h>

#include "core/tlas/grid_cost.h"

namespace gridcast::tlas {
namespace {

/// Boxes that may leave the grid between builds, each tested for every ray: this many, and this share of all.
constexpr std::size_t kFreeOutside = 16;
constexpr std::size_t kOutsideShare = 16384;
/// Share of the instances that change between two looks at how much of the grid they fill.
constexpr std::size_t kLookShare = 128;

/// A ray of a group that goes alone.
struct OneOfGroup {
  const GroupVisitor& group;
  std::uint32_t ray;
  double* far;

  [[nodiscard]] InstanceVisitor visitor() const {
    const auto visit = [](const void* object, std::uint32_t id) {
      const auto& self = *static_cast<const OneOfGroup*>(object);
      self.group.visit(self.group.object, id, 1U << self.ray, self.far);
      self.group.finish(self.group.object, self.far);
      return self.far[self.ray];
    };
    const auto prefetch = [](const void* object, std::uint32_t id) {
      const auto& self = *static_cast<const OneOfGroup*>(object);
      self.group.prefetch(self.group.object, id);
    };
    return {this, visit, prefetch};
  }
};

}  // namespace

std::string_view to_string(TopLevelKind kind) {
  switch (kind) {
    case TopLevelKind::kNone:
      return "none";
    case TopLevelKind::kOneLevel:
      return "one_level";
    case TopLevelKind::kUniformGrid:
      return "uniform_grid";
    case TopLevelKind::kNestedGrid:
      return "nested_grid";
  }
  return "";
}

TopLevelKind TopLevel::kind() const {
  if (!grid_) return TopLevelKind::kNone;
  if (grid_->layout().cell_count() == 1) return TopLevelKind::kOneLevel;
  return grid_->tree_count() > 0 ? TopLevelKind::kNestedGrid : TopLevelKind::kUniformGrid;
}

TopLevel TopLevel::build(std::span<const InstanceBox> boxes, TopLevelChoice choice) {
  BoxTable table;
  table.grow(boxes.size());
  // Whole chunks a task.
  constexpr std::size_t kPerTask = 64 * BoxTable::kChunkSize;
  tbb::parallel_for(std::size_t(0), (boxes.size() + kPerTask - 1) / kPerTask, [&](std::size_t task) {
    for (std::size_t i = task * kPerTask; i < std::min(boxes.size(), (task + 1) * kPerTask); ++i)
      table.write(i) = boxes[i];
  });
  return build(std::move(table), choice);
}

TopLevel TopLevel::build(BoxTable boxes, TopLevelChoice choice) {
  const auto start = std::chrono::steady_clock::now();
  TopLevel level;
  level.choice_ = choice;
  level.boxes_ = std::move(boxes);
  level.build_grid(false);
  level.build_ms_ =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return level;
}

void TopLevel::build_grid(bool moving) {
  const BoxSums sums = sum_boxes(boxes_);
  bounds_ = sums.bounds;
  reachable_ = std::size_t(sums.count);
  has_room_ = moving;
  changes_since_build_ = changes_at_look_ = 0;
  grid_.reset();
  GridChoice chosen{std::nullopt, "No grid was asked for."};
  // The estimate of the memory is for boxes spread evenly; where it was too low, again with fewer cells.
  for (std::uint64_t most_cells = max_cells(reachable_); choice_ == TopLevelChoice::kAuto; most_cells /= 2) {
    chosen = choose_grid(sums, most_cells, moving ? kRoomToMove : 0.0);
    if (!chosen.layout) break;
    most_cells = chosen.layout->cell_count();
    grid_.emplace(*chosen.layout, boxes_);
    if (grid_->block_bytes() <= max_bytes(reachable_) || most_cells == 1) break;
  }
  reason_ = std::move(chosen.reason);
  if (grid_) {
    at_choice_ = grid_->at_build();
    if (const std::size_t trees = grid_->tree_count(); trees > 0) {
      reason_ += " Crowded cells with a tree: ";
      reason_ += std::to_string(trees);
      reason_ += ".";
    }
  }
  list_always();
  outside_at_build_ = always_.size();
}

void TopLevel::list_always() {
  always_.clear();
  for (std::uint32_t id = 0; id < boxes_.size(); ++id) {
    if (grid_ && grid_->at_build().filed == reachable_) break;
    if (boxes_[id].bounds.empty()) continue;
    if (!grid_ || grid_->layout().range_of(boxes_[id]).empty()) always_.push_back(id);
  }
}

namespace {

/// Whether a number is within a quarter of what it was.
bool about(double now, double before) {
  return 4.0 * now <= 5.0 * before && 4.0 * before <= 5.0 * now;
}

bool fills_half(const Bounds3d& bounds, const GridLayout& layout) {
  for (int axis = 0; axis < 3; ++axis)
    if (layout.cells[axis] > 1 && 2.0 * bounds.extent()[axis] < layout.bounds.extent()[axis]) return false;
  return true;
}

}  // namespace

bool TopLevel::refile() {
  if (!grid_ || !has_room_) return false;
  UniformGrid grid(grid_->layout(), boxes_, MakeBlocks::kWhenAsked);
  const FilingSummary& now = grid.at_build();
  const std::size_t outside = now.reachable - now.filed;
  if (outside > outside_at_build_ + kFreeOutside ||
      !about(double(now.reachable), double(at_choice_.reachable)) ||
      !about(double(now.references), double(at_choice_.references)) ||
      !about(now.crowding, at_choice_.crowding) || !fills_half(now.bounds, grid.layout()))
    return false;
  bounds_ = now.bounds;
  reachable_ = now.reachable;
  grid_ = std::move(grid);
  list_always();
  changes_since_build_ = changes_at_look_ = 0;
  return true;
}

void TopLevel::traverse_all(const Ray& ray, double far, const InstanceVisitor& visitor) const {
  if (const std::optional<std::uint32_t> sole = sole_instance()) {
    visitor.visit(visitor.object, *sole);  // the tree's root is box enough
    return;
  }
  const WorldRay world(ray);
  for (const std::uint32_t id : always_)
    if (!intersect_alone(world, boxes_[id], far).empty()) far = visitor.visit(visitor.object, id);
  if (!grid_) return;
  if (world.distance_to(grid_->layout().bounds) <= grid_->layout().reach) {
    grid_->walk(world, far, visitor);
  } else {
    grid_->search(world, far, boxes_, visitor);
  }
}

void TopLevel::traverse_group_all(std::span<const Ray* const> rays, double* far,
                                  const GroupVisitor& visitor) const {
  const auto count = std::uint32_t(rays.size());
  if (const std::optional<std::uint32_t> sole = sole_instance()) {
    visitor.visit(visitor.object, *sole, (1U << count) - 1U, far);
    visitor.finish(visitor.object, far);
    return;
  }
  WorldRay worlds[kGroupSize];
  for (std::uint32_t i = 0; i < count; ++i) worlds[i] = WorldRay(*rays[i]);
  for (const std::uint32_t id : always_) {
    std::uint32_t enter = 0;
    for (std::uint32_t i = 0; i < count; ++i)
      enter |= std::uint32_t(!intersect_alone(worlds[i], boxes_[id], far[i]).empty()) << i;
    if (enter == 0) continue;
    visitor.visit(visitor.object, id, enter, far);
    visitor.finish(visitor.object, far);
  }
  if (!grid_) return;
  std::uint32_t near = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    if (worlds[i].distance_to(grid_->layout().bounds) <= grid_->layout().reach) {
      near |= 1U << i;
    } else if (visitor.goes_on(visitor.object)) {
      const OneOfGroup one{visitor, i, far};
      grid_->search(worlds[i], far[i], boxes_, one.visitor());
    }
  }
  grid_->walk_group(worlds, near, far, visitor);
}

bool TopLevel::worth_rebuilding(std::size_t changes) const {
  if (2 * (changes_since_build_ + changes) >= reachable_ + changes) return true;
  if (!grid_) return false;
  return always_.size() > outside_at_build_ + kFreeOutside + reachable_ / kOutsideShare ||
         grid_->block_bytes() > 2 * max_bytes(reachable_);
}

bool TopLevel::shrunk() {
  changes_at_look_ = changes_since_build_;
  bounds_ = bounds_of(boxes_);
  return !fills_half(bounds_, grid_->layout());
}

void TopLevel::replace(std::uint32_t id, const InstanceBox& old, std::vector<RangeChange>& range_changes) {
  const InstanceBox& box = boxes_[id];
  if (old == box) return;
  const auto range_of = [&](const InstanceBox& b) {
    return grid_ ? grid_->layout().range_of(b) : CellRange{};
  };
  const CellRange before = range_of(old), after = range_of(box);
  if (!before.empty() || !after.empty()) range_changes.push_back({id, before, after});

  const bool was_reachable = !old.bounds.empty(), reachable = !box.bounds.empty();
  const bool was_alone = was_reachable && before.empty(), alone = reachable && after.empty();
  const auto place = std::lower_bound(always_.begin(), always_.end(), id);
  if (was_alone && !alone) always_.erase(place);
  if (alone && !was_alone) always_.insert(place, id);
  bounds_.extend(box.bounds);
  reachable_ += std::size_t(reachable) - std::size_t(was_reachable);
}

void TopLevel::update(BoxTable boxes, std::span<const std::uint32_t> changed) {
  const auto start = std::chrono::steady_clock::now();
  const BoxTable before = std::exchange(boxes_, std::move(boxes));
  if (!worth_rebuilding(changed.size())) {
    std::vector<RangeChange> range_changes;
    for (const std::uint32_t id : changed)
      replace(id, id < before.size() ? before[id] : InstanceBox{}, range_changes);
    if (grid_) grid_->apply(range_changes, boxes_);
    changes_since_build_ += changed.size();
    const bool look = grid_ && kLookShare * (changes_since_build_ - changes_at_look_) >= reachable_;
    if (!worth_rebuilding(0) && !(look && shrunk())) return;
  }
  if (!refile()) build_grid(true);
  build_ms_ = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace gridcast::tlas
