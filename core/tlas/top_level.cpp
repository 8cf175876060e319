#include "core/tlas/top_level.h"

#include <algorithm>
#include <chrono>

#include <tbb/parallel_for.h>

#include "core/tlas/grid_cost.h"

namespace gridcast::tlas {
namespace {

/// Boxes that may leave the grid between builds: this many, and this share of all.
constexpr std::size_t kFreeOutside = 16;
constexpr std::size_t kOutsideShare = 512;

}  // namespace

std::string_view to_string(TopLevelKind kind) {
  return kind == TopLevelKind::kNone ? "none" : "uniform_grid";
}

TopLevel TopLevel::build(std::span<const InstanceBox> boxes, TopLevelChoice choice) {
  const auto start = std::chrono::steady_clock::now();
  TopLevel level;
  level.choice_ = choice;
  level.reason_ = "No grid was asked for.";
  std::optional<GridLayout> layout;
  if (choice == TopLevelChoice::kAuto) {
    GridChoice chosen = choose_grid(boxes);
    layout = chosen.layout;
    level.reason_ = std::move(chosen.reason);
  }

  std::vector<CellRange> ranges(boxes.size());
  level.entries_.grow(boxes.size());
  // Whole chunks of entries a task.
  constexpr std::size_t kPerTask = 16 * decltype(entries_)::kChunkSize;
  tbb::parallel_for(std::size_t(0), (boxes.size() + kPerTask - 1) / kPerTask, [&](std::size_t task) {
    for (std::size_t i = task * kPerTask; i < std::min(boxes.size(), (task + 1) * kPerTask); ++i) {
      if (layout) ranges[i] = layout->range_of(boxes[i]);
      level.entries_.write(i) = {boxes[i].bounds, boxes[i].drift, ranges[i]};
    }
  });
  for (std::uint32_t id = 0; id < boxes.size(); ++id) {
    if (boxes[id].bounds.empty()) continue;
    level.bounds_.extend(boxes[id].bounds);
    ++level.reachable_;
    if (ranges[id].empty()) level.always_.push_back(id);
  }
  level.outside_at_build_ = level.always_.size();
  if (layout) level.grid_.emplace(*layout, ranges);
  level.build_ms_ =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return level;
}

bool TopLevel::worth_rebuilding(std::size_t changes) const {
  if (2 * (changes_since_build_ + changes) >= reachable_ + changes) return true;
  if (!grid_) return false;
  return always_.size() > outside_at_build_ + kFreeOutside + reachable_ / kOutsideShare ||
         grid_->reference_count() > max_references(reachable_);
}

void TopLevel::replace(const BoxChange& change, std::vector<RangeChange>& range_changes) {
  const std::uint32_t id = change.instance_id;
  Entry& entry = entries_.write(id);
  const bool was_reachable = !entry.bounds.empty(), reachable = !change.box.bounds.empty();
  const bool was_alone = was_reachable && entry.range.empty();
  const CellRange before = entry.range;
  const CellRange after = grid_ ? grid_->layout().range_of(change.box) : CellRange{};
  entry = {change.box.bounds, change.box.drift, after};
  if (!(before == after)) range_changes.push_back({id, before, after});

  const bool alone = reachable && after.empty();
  const auto place = std::lower_bound(always_.begin(), always_.end(), id);
  if (was_alone && !alone) always_.erase(place);
  if (alone && !was_alone) always_.insert(place, id);
  bounds_.extend(change.box.bounds);
  reachable_ += std::size_t(reachable) - std::size_t(was_reachable);
}

TopLevel TopLevel::updated(std::span<const BoxChange> changes) const {
  std::size_t slots = entries_.size();
  for (const BoxChange& change : changes) slots = std::max(slots, std::size_t(change.instance_id) + 1);

  if (!worth_rebuilding(changes.size())) {
    TopLevel next = *this;
    next.entries_.grow(slots);
    std::vector<RangeChange> range_changes;
    for (const BoxChange& change : changes) next.replace(change, range_changes);
    if (next.grid_) next.grid_->apply(range_changes);
    next.changes_since_build_ += changes.size();
    if (!next.worth_rebuilding(0)) return next;
  }
  std::vector<InstanceBox> boxes(slots);
  for (std::uint32_t id = 0; id < entries_.size(); ++id) boxes[id] = box(id);
  for (const BoxChange& change : changes) boxes[change.instance_id] = change.box;
  return build(boxes, choice_);
}

}  // namespace gridcast::tlas
