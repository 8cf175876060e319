#include "core/tlas/top_level.h"

namespace gridcast::tlas {

std::string_view to_string(TopLevelKind kind) {
  return kind == TopLevelKind::kNone ? "none" : "uniform_grid";
}

TopLevel TopLevel::build(std::span<const InstanceBox> boxes) {
  TopLevel level;
  level.boxes_.grow(boxes.size());
  for (std::uint32_t id = 0; id < boxes.size(); ++id) {
    level.boxes_.write(id) = boxes[id];
    if (boxes[id].bounds.empty()) continue;
    level.always_.push_back(id);
    level.bounds_.extend(boxes[id].bounds);
  }
  return level;
}

TopLevel TopLevel::updated(std::span<const BoxChange> changes) const {
  std::vector<InstanceBox> boxes(boxes_.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) boxes[i] = boxes_[i];
  for (const BoxChange& change : changes) {
    if (change.instance_id >= boxes.size()) boxes.resize(change.instance_id + 1);
    boxes[change.instance_id] = change.box;
  }
  return build(boxes);
}

TopLevelStats TopLevel::stats() const {
  TopLevelStats stats;
  stats.reason = "Every instance box is tested.";
  stats.bounds = bounds_;
  stats.instance_count = always_.size();
  stats.reference_count = always_.size();
  stats.memory_bytes = boxes_.memory_bytes() + always_.capacity() * sizeof(always_[0]);
  return stats;
}

Status TopLevel::validate() const {
  return ok_status();
}

}  // namespace gridcast::tlas
