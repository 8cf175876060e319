#include "core/math/ray_way.h"

#include <algorithm>

namespace gridcast {

bool RayWay::goes_on() {
  is_stopped_ = is_stopped_ || stop_.stop_requested();
  return !is_stopped_ && !is_truncated_;
}

bool RayWay::add(const WayStep& step) {
  if (!goes_on()) return false;
  if (steps_.size() == max_steps_) {
    is_truncated_ = true;
    return false;
  }
  std::visit([this](const auto& one) { count(one); }, step);
  steps_.push_back(step);
  return true;
}

void RayWay::count(const CellStep& step) {
  ++counts_.cells;
  counts_.skipped_blocks += step.skipped_blocks;
}

void RayWay::count(const BlockStep& step) {
  ++counts_.blocks;
  counts_.skipped_blocks += step.skipped_blocks;
}

void RayWay::count(const CellNodeStep& step) {
  ++counts_.cell_nodes;
  counts_.max_stack = std::max(counts_.max_stack, step.stack);
}

void RayWay::count(const InstanceStep& step) {
  ++(step.outcome == InstanceOutcome::kEntered ? counts_.instances : counts_.passed_instances);
}

void RayWay::count(const NodeStep& step) {
  ++counts_.nodes;
  counts_.max_stack = std::max(counts_.max_stack, step.stack);
}

void RayWay::count(const LeafStep& step) {
  ++counts_.leaves;
  counts_.max_stack = std::max(counts_.max_stack, step.stack);
}

void RayWay::count(const TriangleStep& step) {
  ++(step.verdict == TriangleVerdict::kFiltered ? counts_.filtered_triangles : counts_.triangles);
}

void RayWay::count(const OpaqueStep& /*step*/) {}

}  // namespace gridcast
