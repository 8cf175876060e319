#include "core/measure/exact/box_tree.h"

#include <algorithm>
#include <numeric>

namespace gridcast::measure::exact {
namespace {

constexpr std::uint32_t kLeafSize = 4;

}  // namespace

BoxTree::BoxTree(std::span<const Box> boxes, const std::stop_token& stop) : items_(boxes.size()) {
  if (boxes.empty()) return;
  std::iota(items_.begin(), items_.end(), 0U);
  nodes_.reserve(boxes.size());
  nodes_.push_back({{}, 0, std::uint32_t(boxes.size())});
  for (std::uint32_t node = 0; node < nodes_.size() && !stop.stop_requested(); ++node) split(node, boxes);
}

void BoxTree::split(std::uint32_t index, std::span<const Box> boxes) {
  const std::uint32_t first = nodes_[index].first, count = nodes_[index].count;
  Box all = boxes[items_[first]];
  Box centres{all.lower + all.upper, all.lower + all.upper};  // of twice the centre
  for (std::uint32_t i = first; i < first + count; ++i) {
    const Box& box = boxes[items_[i]];
    all = {glm::min(all.lower, box.lower), glm::max(all.upper, box.upper)};
    centres.lower = glm::min(centres.lower, box.lower + box.upper);
    centres.upper = glm::max(centres.upper, box.lower + box.upper);
  }
  nodes_[index].box = all;
  if (count <= kLeafSize) return;

  const Vec3d size = centres.upper - centres.lower;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const std::uint32_t half = count / 2;
  const auto begin = items_.begin() + first;
  std::nth_element(begin, begin + half, begin + count, [&](std::uint32_t a, std::uint32_t b) {
    return boxes[a].lower[axis] + boxes[a].upper[axis] < boxes[b].lower[axis] + boxes[b].upper[axis];
  });
  nodes_[index].first = std::uint32_t(nodes_.size());
  nodes_[index].count = 0;
  nodes_.push_back({{}, first, half});
  nodes_.push_back({{}, first + half, count - half});
}

}  // namespace gridcast::measure::exact
