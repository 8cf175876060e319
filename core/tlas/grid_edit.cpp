// Changes to a grid: copies of the touched blocks with some references added and removed.

#include <algorithm>
#include <tuple>

#include "core/tlas/uniform_grid.h"

namespace gridcast::tlas {

void UniformGrid::apply(std::span<const RangeChange> changes) {
  std::vector<CellEdit> edits;
  for (const RangeChange& change : changes) {
    const auto add_edits = [&](const CellRange& range, const CellRange& other, bool listed) {
      range.for_each([&](const Cell& cell) {
        if (other.contains(cell)) return;
        const CellAddress at = address(cell);
        edits.push_back({at.block, at.local, change.instance_id, listed});
      });
    };
    add_edits(change.before, change.after, false);
    add_edits(change.after, change.before, true);
  }
  std::sort(edits.begin(), edits.end(), [](const CellEdit& a, const CellEdit& b) {
    return std::tie(a.block, a.local, a.instance_id) < std::tie(b.block, b.local, b.instance_id);
  });
  for (std::size_t begin = 0, end = 0; begin < edits.size(); begin = end) {
    while (end < edits.size() && edits[end].block == edits[begin].block) ++end;
    edit_block(edits[begin].block, {edits.data() + begin, end - begin});
  }
}

void UniformGrid::edit_block(std::uint32_t index, std::span<const CellEdit> edits) {
  const GridBlock* old = block(index);
  auto edited = std::make_shared<GridBlock>();
  edited->first.reserve(cells_per_block() + 1);
  edited->ids.reserve((old != nullptr ? old->ids.size() : 0) + edits.size());
  auto edit = edits.begin();
  for (std::uint32_t local = 0; local < cells_per_block(); ++local) {
    edited->first.push_back(std::uint32_t(edited->ids.size()));
    const auto listed = old != nullptr ? old->list(local) : std::span<const std::uint32_t>{};
    auto id = listed.begin();
    // Merge the two ascending sequences; a removal skips the id it names.
    for (; edit != edits.end() && edit->local == local; ++edit) {
      while (id != listed.end() && *id < edit->instance_id) edited->ids.push_back(*id++);
      if (edit->listed) {
        edited->ids.push_back(edit->instance_id);
      } else {
        ++id;
      }
    }
    edited->ids.insert(edited->ids.end(), id, listed.end());
  }
  edited->first.push_back(std::uint32_t(edited->ids.size()));
  edited->ids.shrink_to_fit();

  reference_count_ += edited->ids.size() - (old != nullptr ? old->ids.size() : 0);
  used_blocks_ += std::size_t(!edited->ids.empty()) - std::size_t(old != nullptr);
  blocks_.write(index) = edited->ids.empty() ? nullptr : std::move(edited);
}

std::size_t UniformGrid::memory_bytes() const {
  const std::size_t block = sizeof(GridBlock) + (cells_per_block() + 1) * sizeof(std::uint32_t);
  return blocks_.memory_bytes() + used_blocks_ * block + reference_count_ * sizeof(std::uint32_t);
}

}  // namespace gridcast::tlas
