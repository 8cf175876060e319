#include "core/tlas/cell_tree.h"

#include <algorithm>

namespace gridcast::tlas {
namespace {

constexpr std::size_t kSlots = 8;

class TreeBuilder {
 public:
  TreeBuilder(const Cell& cell, TreeGroups& groups) : cell_(cell), groups_(groups), root_(groups.size()) {}

  /// Returns the link to what holds `records`, with their box and the `seen` bits that all of them share.
  struct Built {
    std::uint32_t link;
    Bounds3f box;
    std::uint32_t seen;
  };
  Built build(std::span<const BoxRecord*> records) {
    return records.size() <= kSlots ? leaf(records) : node(records);
  }

 private:
  std::size_t append() {
    groups_.emplace_back();
    groups_.back().clear();
    return groups_.size() - 1;
  }

  Built leaf(std::span<const BoxRecord*> records) {
    const std::size_t at = append();
    Built built{std::uint32_t(at - root_) | tree_link::kLeafBit, {}, ~0U};
    for (std::size_t slot = 0; slot < records.size(); ++slot) {
      set_instance(groups_[at], slot, *records[slot], cell_);
      built.box.extend(records[slot]->box);
      built.seen &= records[slot]->seen_from(cell_);
    }
    return built;
  }

  Built node(std::span<const BoxRecord*> records) {
    const std::size_t at = append();
    // Whole leaves, shared among the children as evenly as can be.
    const std::size_t leaves = (records.size() + kSlots - 1) / kSlots;
    const std::size_t children = std::min(leaves, kSlots);
    std::size_t begins[kSlots + 1];
    for (std::size_t k = 0; k <= children; ++k)
      begins[k] = std::min(leaves * k / children * kSlots, records.size());
    partition(records, begins, 0, children);
    Built built{std::uint32_t(at - root_), {}, ~0U};
    for (std::size_t k = 0; k < children; ++k) {
      const Built child = build(records.subspan(begins[k], begins[k + 1] - begins[k]));
      BoxGroup<kSlots>& group = groups_[at];
      group.set_box(k, child.box);
      group.links[k] = child.link;
      for (std::size_t side = 0; side < 6; ++side)
        group.seen[side] |= std::uint8_t(((child.seen >> side) & 1U) << k);
      built.box.extend(child.box);
      built.seen &= child.seen;
    }
    return built;
  }

  /// Sorts the records into parts first .. last, halving along the longest extent of their centres.
  static void partition(std::span<const BoxRecord*> records, const std::size_t* begins, std::size_t first,
                        std::size_t last) {
    if (last - first < 2) return;
    Bounds3f centers;
    for (std::size_t i = begins[first]; i < begins[last]; ++i) centers.extend(twice_center(*records[i]));
    const Vec3f extent = centers.extent();
    const int axis = extent.x >= extent.y ? (extent.x >= extent.z ? 0 : 2) : (extent.y >= extent.z ? 1 : 2);
    const std::size_t middle = (first + last) / 2;
    const auto at = [&](std::size_t part) { return records.begin() + std::ptrdiff_t(begins[part]); };
    std::nth_element(at(first), at(middle), at(last), [axis](const BoxRecord* a, const BoxRecord* b) {
      const float x = twice_center(*a)[axis], y = twice_center(*b)[axis];
      return x < y || (x == y && a->instance_id < b->instance_id);
    });
    partition(records, begins, first, middle);
    partition(records, begins, middle, last);
  }
  static Vec3f twice_center(const BoxRecord& record) { return record.box.lower + record.box.upper; }

  Cell cell_;
  TreeGroups& groups_;
  std::size_t root_;
};

}  // namespace

void append_cell_tree(std::span<const BoxRecord*> records, const Cell& cell, TreeGroups& groups) {
  TreeBuilder(cell, groups).build(records);
}

}  // namespace gridcast::tlas
