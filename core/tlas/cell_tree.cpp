#include "core/tlas/cell_tree.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "core/tlas/cell_lists.h"

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

/// Bits that compare, as unsigned numbers, like the floats.
std::uint32_t ordered_bits(float x) {
  const auto bits = std::bit_cast<std::uint32_t>(x);
  return bits ^ ((bits >> 31) != 0 ? 0xFFFFFFFFU : 0x80000000U);
}

std::uint64_t median(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
  return std::max(std::min(a, b), std::min(std::max(a, b), c));
}

/// std::nth_element for keys that all differ: "Algorithm 65: find", C. A. R. Hoare, 1961, but parted as by N.
/// Lomuto and without a branch on the comparison, which would be guessed wrong half of the time. Keys for
/// which its pivots are bad time and again are left to the library.
void select(std::span<std::uint64_t> keys, std::size_t nth) {
  std::size_t rounds = 4 * std::size_t(std::bit_width(keys.size()));
  while (keys.size() > 3 && rounds-- > 0) {
    // The median of three is not the least, so both parts get something.
    const std::uint64_t pivot = median(keys.front(), keys[keys.size() / 2], keys.back());
    std::size_t below = 0;
    for (std::uint64_t& key : keys) {
      const std::uint64_t moved = std::exchange(key, keys[below]);
      keys[below] = moved;
      below += std::size_t(moved < pivot);
    }
    if (nth < below) {
      keys = keys.first(below);
    } else {
      keys = keys.subspan(below);
      nth -= below;
    }
  }
  std::nth_element(keys.begin(), keys.begin() + std::ptrdiff_t(nth), keys.end());
}

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
  keys_.resize(records.size());
  centers_.resize(records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    const Vec3f center = records[i]->box.lower + records[i]->box.upper;
    centers_[i] = {center.x, center.y, center.z, 0.F};
    keys_[i] = Key(i);
  }
  records_ = records;
  cell_ = cell;
  groups_ = groups;
  used_ = 0;
  build(keys_);
}

CellTreeBuilder::Built CellTreeBuilder::build(std::span<Key> keys) {
  return keys.size() <= kSlots ? leaf(keys) : node(keys);
}

CellTreeBuilder::Built CellTreeBuilder::leaf(std::span<const Key> keys) {
  const std::size_t at = used_++;
  Built built{std::uint32_t(at) | tree_link::kLeafBit, {}, ~0U};
  const BoxRecord* records[kSlots];
  std::fill(std::begin(records), std::end(records), &kNoRecord);
  for (std::size_t slot = 0; slot < keys.size(); ++slot) {
    records[slot] = records_[std::uint32_t(keys[slot])];
    built.box.extend(records[slot]->box);
    built.seen &= records[slot]->seen_from(cell_);
  }
  write_group(records, CellNumbers(cell_), groups_[at]);
  return built;
}

CellTreeBuilder::Built CellTreeBuilder::node(std::span<Key> keys) {
  const std::size_t at = used_++;
  const Children children(keys.size());
  partition(keys, children.begins, 0, children.size);
  Built built{std::uint32_t(at), {}, ~0U};
  BoxGroup<kSlots>& group = groups_[at];
  group.clear();
  for (std::size_t k = 0; k < children.size; ++k) {
    const Built child = build(keys.subspan(children.begins[k], children.begins[k + 1] - children.begins[k]));
    group.set_box(k, child.box);
    group.links[k] = child.link;
    for (std::size_t side = 0; side < 6; ++side)
      group.seen[side] |= std::uint8_t(((child.seen >> side) & 1U) << k);
    built.box.extend(child.box);
    built.seen &= child.seen;
  }
  return built;
}

/// Sorts the keys into parts first .. last, halving along the longest extent of the centres.
void CellTreeBuilder::partition(std::span<Key> keys, const std::size_t* begins, std::size_t first,
                                std::size_t last) {
  if (last - first < 2) return;
  const std::span<Key> all = keys.subspan(begins[first], begins[last] - begins[first]);
  std::array<float, 4> lower = centers_[std::uint32_t(all[0])], upper = lower;
  for (const Key key : all) {
    const std::array<float, 4>& center = centers_[std::uint32_t(key)];
    for (std::size_t axis = 0; axis < 4; ++axis) {
      lower[axis] = std::min(lower[axis], center[axis]);
      upper[axis] = std::max(upper[axis], center[axis]);
    }
  }
  const Vec3f extent{upper[0] - lower[0], upper[1] - lower[1], upper[2] - lower[2]};
  const std::size_t axis =
      extent.x >= extent.y ? (extent.x >= extent.z ? 0 : 2) : (extent.y >= extent.z ? 1 : 2);
  for (Key& key : all) {
    const auto record = std::uint32_t(key);
    key = (Key(ordered_bits(centers_[record][axis])) << 32) | Key(record);
  }
  const std::size_t middle = (first + last) / 2;
  select(all, begins[middle] - begins[first]);
  partition(keys, begins, first, middle);
  partition(keys, begins, middle, last);
}

}  // namespace gridcast::tlas
