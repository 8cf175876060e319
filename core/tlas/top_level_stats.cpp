// What a top level is made of, and whether it is sound.

#include <algorithm>

#include "core/tlas/top_level.h"

namespace gridcast::tlas {
namespace {

Error broken(std::string message, std::string where) {
  return {ErrorCode::kInternal, std::move(message), std::move(where)};
}

std::string name_of(const Cell& cell) {
  return "/cells/" + std::to_string(cell[0]) + "," + std::to_string(cell[1]) + "," + std::to_string(cell[2]);
}

}  // namespace

std::size_t TopLevel::memory_bytes() const {
  return entries_.memory_bytes() + always_.capacity() * sizeof(always_[0]) +
         (grid_ ? grid_->memory_bytes() : 0);
}

TopLevelStats TopLevel::stats() const {
  TopLevelStats stats;
  stats.kind = kind();
  stats.reason = reason_;
  stats.bounds = bounds_;
  stats.instance_count = reachable_;
  stats.always_tested = always_.size();
  stats.memory_bytes = memory_bytes();
  stats.build_ms = build_ms_;
  if (!grid_) return stats;

  const GridLayout& layout = grid_->layout();
  std::copy(std::begin(layout.cells), std::end(layout.cells), std::begin(stats.cells));
  stats.bounds = layout.bounds;
  stats.cell_count = layout.cell_count();
  stats.reference_count = grid_->reference_count();
  for (std::uint32_t b = 0; b < grid_->block_count(); ++b) {
    const GridBlock* block = grid_->block(b);
    if (block == nullptr) continue;
    for (std::uint32_t local = 0; local < grid_->cells_per_block(); ++local) {
      const std::size_t count = block->list(local).size();
      stats.occupied_cells += std::size_t(count > 0);
      stats.max_references_in_cell = std::max(stats.max_references_in_cell, count);
    }
  }
  return stats;
}

Status TopLevel::validate() const {
  std::uint64_t references = 0;
  std::size_t reachable = 0;
  std::vector<std::uint32_t> alone;
  for (std::uint32_t id = 0; id < entries_.size(); ++id) {
    const Entry& entry = entries_[id];
    const std::string where = "/instances/" + std::to_string(id);
    const CellRange range = grid_ ? grid_->layout().range_of(entry.box()) : CellRange{};
    if (!(range == entry.range)) return broken("the cell range is not that of the box", where);
    references += range.cell_count();
    if (entry.bounds.empty()) continue;
    ++reachable;
    if (!bounds_.contains(entry.bounds)) return broken("the box is outside the bounds", where);
    if (range.empty()) alone.push_back(id);
  }
  if (reachable != reachable_) return broken("the number of reachable instances is wrong", "");
  if (alone != always_) return broken("the list of always tested instances is wrong", "");
  return grid_ ? grid_->validate(entries_, references) : ok_status();
}

// Ascending lists of instances whose range holds the cell, as many references as all ranges have cells:
// together they say that every instance is in exactly the cells of its range.
Status UniformGrid::validate(const ChunkedVector<Entry>& entries, std::uint64_t references) const {
  std::uint64_t found = 0;
  for (std::uint32_t b = 0; b < block_count(); ++b) {
    const GridBlock* held = block(b);
    if (held == nullptr) continue;
    found += held->ids.size();
    if (held->first.size() != cells_per_block() + 1 || held->first.back() != held->ids.size())
      return broken("the rows of a block do not fit its references", "/blocks/" + std::to_string(b));
    Status status = ok_status();
    std::uint64_t inside = 0;
    cells_of_block(b).for_each([&](const Cell& cell) {
      const auto list = held->list(address(cell).local);
      inside += list.size();
      for (std::size_t k = 0; k < list.size(); ++k) {
        const bool known = list[k] < entries.size() && entries[list[k]].range.contains(cell);
        if (!known || (k > 0 && list[k - 1] >= list[k]))
          status = broken("a cell lists an instance that is not in it, or twice", name_of(cell));
      }
    });
    if (!status) return status;
    if (inside != held->ids.size())
      return broken("a block lists instances outside the grid", "/blocks/" + std::to_string(b));
  }
  if (found != references || found != reference_count_)
    return broken("the number of references is not that of the ranges", "/cells");
  return ok_status();
}

}  // namespace gridcast::tlas
