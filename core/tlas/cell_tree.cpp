#include "core/tlas/cell_tree.h"

#include <algorithm>

namespace gridcast::tlas {
namespace {

constexpr std::size_t kSlots = 8;

/// Where the children of a node over `count` instances begin: whole leaves, shared among them as evenly as
/// can be.
struct Children {
  explicit Children(std::size_t count) {
    const std::size_t leaves = (count + kSlots - 1) / kSlots;
    size = std::min(leaves, kSlots);
    for (std::size_t k = 0; k <= size; ++k) begins[k] = std::min(leaves * k / size * kSlots, count);
  }
  std::size_t begins[kSlots + 1] = {};
  std::size_t size;
};

}  // namespace

std::size_t cell_tree_size(std::size_t instances) {
  if (instances <= kSlots) return 1;
  const Children children(instances);
  std::size_t size = 1;
  for (std::size_t k = 0; k < children.size; ++k)
    size += cell_tree_size(children.begins[k + 1] - children.begins[k]);
  return size;
}

void CellTreeBuilder::build(std::span<const BoxRecord* const> records, const Cell& cell,
                            std::span<BoxGroup<8>> groups) {
  items_.resize(records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Vec3f center = records[i]->box.lower + records[i]->box.upper;
    items_[i] = {{center.x, center.y, center.z}, std::uint32_t(i)};
  }
  records_ = records;
  cell_ = cell;
  groups_ = groups;
  used_ = 0;
  build(items_);
}

CellTreeBuilder::Built CellTreeBuilder::build(std::span<Item> items) {
  return items.size() <= kSlots ? leaf(items) : node(items);
}

CellTreeBuilder::Built CellTreeBuilder::leaf(std::span<const Item> items) {
  const std::size_t at = used_++;
  Built built{std::uint32_t(at) | tree_link::kLeafBit, {}, ~0U};
  const BoxRecord* records[kSlots];
  for (std::size_t slot = 0; slot < items.size(); ++slot) {
    records[slot] = records_[items[slot].record];
    built.box.extend(records[slot]->box);
    built.seen &= records[slot]->seen_from(cell_);
  }
  set_instances<kSlots>(groups_[at], {records, items.size()}, cell_);
  return built;
}

CellTreeBuilder::Built CellTreeBuilder::node(std::span<Item> items) {
  const std::size_t at = used_++;
  const Children children(items.size());
  partition(items, children.begins, 0, children.size);
  Built built{std::uint32_t(at), {}, ~0U};
  BoxGroup<kSlots>& group = groups_[at];
  group.clear();
  for (std::size_t k = 0; k < children.size; ++k) {
    const Built child = build(items.subspan(children.begins[k], children.begins[k + 1] - children.begins[k]));
    group.set_box(k, child.box);
    group.links[k] = child.link;
    for (std::size_t side = 0; side < 6; ++side)
      group.seen[side] |= std::uint8_t(((child.seen >> side) & 1U) << k);
    built.box.extend(child.box);
    built.seen &= child.seen;
  }
  return built;
}

/// Sorts the items into parts first .. last, halving along the longest extent of their centres.
void CellTreeBuilder::partition(std::span<Item> items, const std::size_t* begins, std::size_t first,
                                std::size_t last) {
  if (last - first < 2) return;
  float lower[3], upper[3];
  for (int axis = 0; axis < 3; ++axis) lower[axis] = upper[axis] = items[begins[first]].center[axis];
  for (std::size_t i = begins[first]; i < begins[last]; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      lower[axis] = std::min(lower[axis], items[i].center[axis]);
      upper[axis] = std::max(upper[axis], items[i].center[axis]);
    }
  }
  const Vec3f extent{upper[0] - lower[0], upper[1] - lower[1], upper[2] - lower[2]};
  const int axis = extent.x >= extent.y ? (extent.x >= extent.z ? 0 : 2) : (extent.y >= extent.z ? 1 : 2);
  const std::size_t middle = (first + last) / 2;
  const auto at = [&](std::size_t part) { return items.begin() + std::ptrdiff_t(begins[part]); };
  std::nth_element(at(first), at(middle), at(last), [axis](const Item& a, const Item& b) {
    const float x = a.center[axis], y = b.center[axis];
    return x < y || (x == y && a.record < b.record);
  });
  partition(items, begins, first, middle);
  partition(items, begins, middle, last);
}

}  // namespace gridcast::tlas
