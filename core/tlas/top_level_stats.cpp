// What a top level is made of, and whether it is sound.

#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "core/tlas/box_record.h"
#include "core/tlas/cell_reader.h"
#include "core/tlas/grid_cost.h"
#include "core/tlas/top_level.h"

namespace gridcast::tlas {
namespace {

Error broken(std::string message, std::string where) {
  return {ErrorCode::kInternal, std::move(message), std::move(where)};
}

std::string name_of(const Cell& cell) {
  return "/cells/" + std::to_string(cell[0]) + "," + std::to_string(cell[1]) + "," + std::to_string(cell[2]);
}

/// What a cell costs a ray by the cost model, with as many instances as it has.
double cost_of_cell(std::size_t count) {
  if (count > kMaxFlat)
    return kCellCost + kNodeCost * (1.0 + kNodesPerDoubling * std::log2(double(count) / 8.0));
  return kCellCost + kGroupCost * std::ceil(double(count) / 8.0);
}

/// What a random line that meets the box `scene` costs in a grid around it, when nothing stops it:
/// `cells_cost` is the sum over the cells, each of which it meets by the share of its surface.
double cost_of_ray(const GridLayout& layout, const Bounds3d& scene, double cells_cost) {
  const Vec3d cells = glm::max(scene.extent() / layout.cell, Vec3d(1.0));
  const Vec3d part = glm::min(scene.extent(), layout.cell);  // of a cell that is inside
  const double share =
      Bounds3d{Vec3d(0.0), part}.half_area() / Bounds3d{Vec3d(0.0), scene.extent()}.half_area();
  return kWalkCost + share * (kStepCost * cells.x * cells.y * cells.z + cells_cost);
}

}  // namespace

std::size_t TopLevel::memory_bytes() const {
  return boxes_.memory_bytes() + always_.capacity() * sizeof(always_[0]) +
         (grid_ ? grid_->memory_bytes() : 0);
}

UniformGrid::Stats UniformGrid::stats() const {
  make_blocks();
  Stats stats;
  for (std::uint32_t b = 0; b < layout_.block_count(); ++b) {
    const GridBlock* held = block(b);
    if (held == nullptr) continue;
    stats.tree_cells += held->tree_count();
    stats.occupied_cells += std::size_t(std::popcount(held->occupancy()));
    for (std::uint32_t local = 0; local < 64; ++local) {
      if (!held->occupied(local)) continue;
      std::size_t count = 0;
      CellReader([&](auto&&...) { ++count; }).read(held->cell(local));
      stats.cells_cost += cost_of_cell(count);
      stats.max_references_in_cell = std::max(stats.max_references_in_cell, count);
    }
  }
  return stats;
}

TopLevelStats TopLevel::stats() const {
  TopLevelStats stats;
  stats.kind = kind();
  stats.reason = reason_;
  stats.bounds = bounds_;
  stats.instance_count = reachable_;
  stats.always_tested = always_.size();
  stats.build_ms = build_ms_;
  if (!grid_) {
    stats.memory_bytes = memory_bytes();
    return stats;
  }

  const GridLayout& layout = grid_->layout();
  const UniformGrid::Stats cells = grid_->stats();
  std::copy(std::begin(layout.cells), std::end(layout.cells), std::begin(stats.cells));
  stats.bounds = layout.bounds;
  stats.cell_count = layout.cell_count();
  stats.memory_bytes = memory_bytes();  // with the blocks that this has made
  stats.occupied_cells = cells.occupied_cells;
  stats.tree_cells = cells.tree_cells;
  stats.reference_count = grid_->reference_count();
  stats.max_references_in_cell = cells.max_references_in_cell;
  Bounds3d scene;
  for (std::size_t id = 0; id < boxes_.size(); ++id) scene.extend(boxes_[id].bounds);
  stats.ray_cost = cost_of_ray(layout, scene, cells.cells_cost);
  return stats;
}

Status TopLevel::validate() const {
  std::size_t reachable = 0;
  std::vector<std::uint32_t> alone;
  for (std::uint32_t id = 0; id < boxes_.size(); ++id) {
    if (boxes_[id].bounds.empty()) continue;
    ++reachable;
    if (!bounds_.contains(boxes_[id].bounds))
      return broken("the box is outside the bounds", "/instances/" + std::to_string(id));
    if (!grid_ || grid_->layout().range_of(boxes_[id]).empty()) alone.push_back(id);
  }
  if (reachable != reachable_) return broken("the number of reachable instances is wrong", "");
  if (alone != always_) return broken("the list of always tested instances is wrong", "");
  return grid_ ? grid_->validate(boxes_) : ok_status();
}

// Every cell lists, once each, instances whose range holds it, and there are as many references as all ranges
// have cells: together they say that every instance is in exactly the cells of its range.
Status UniformGrid::validate(const BoxTable& boxes) const {
  std::uint64_t expected = 0, found = 0;
  for (std::uint32_t id = 0; id < boxes.size(); ++id) {
    expected += layout_.range_of(boxes[id]).cell_count();
    if (!layout_.range_of(boxes[id]).empty() && boxes[id].drift > max_drift_)
      return broken("the largest drift is not the largest", "/instances/" + std::to_string(id));
  }
  for (std::uint32_t b = 0; b < layout_.block_count(); ++b) {
    const GridBlock* held = block(b);
    if (held == nullptr) continue;
    if (Status status = validate_block(b, boxes, found); !status) return status;
  }
  if (found != expected || found != reference_count_)
    return broken("the number of references is not that of the ranges", "/cells");
  return ok_status();
}

Status UniformGrid::validate_block(std::uint32_t index, const BoxTable& boxes, std::uint64_t& found) const {
  const GridBlock& held = *block(index);
  std::vector<std::uint32_t> in_block;
  std::uint64_t occupied = 0;
  Status status = ok_status();
  layout_.cells_of_block(index).for_each([&](const Cell& cell) {
    const std::uint32_t local = layout_.local_of(cell);
    if (!held.occupied(local)) return;
    occupied |= std::uint64_t(1) << local;
    std::vector<std::uint32_t> ids;
    const bool sound =
        CellReader([&](std::uint32_t id, const Bounds3f& box, std::uint32_t seen) {
          ids.push_back(id);
          const CellRange range = id < boxes.size() ? layout_.range_of(boxes[id]) : CellRange{};
          if (!range.contains(cell)) {
            status = broken("a cell lists an instance that is not in it", name_of(cell));
            return;
          }
          if (BoxRecord{{}, id, range}.seen_from(cell) != seen)
            status = broken("a neighbour is wrongly taken to list an instance", name_of(cell));
          const Bounds3d placed{Vec3d(box.lower) + layout_.center, Vec3d(box.upper) + layout_.center};
          if (!placed.contains(boxes[id].bounds))
            status = broken("a packed box does not hold its instance", name_of(cell));
        }).read(held.cell(local));
    std::sort(ids.begin(), ids.end());
    if (!sound || ids.empty() || std::adjacent_find(ids.begin(), ids.end()) != ids.end())
      status = broken("the groups of a cell are not sound", name_of(cell));
    found += ids.size();
    in_block.insert(in_block.end(), ids.begin(), ids.end());
  });
  if (!status) return status;
  const std::string where = "/blocks/" + std::to_string(index);
  if (occupied != held.occupancy()) return broken("a block has cells outside the grid", where);
  if (in_block.size() != held.reference_count()) return broken("a block miscounts its references", where);
  std::sort(in_block.begin(), in_block.end());
  in_block.erase(std::unique(in_block.begin(), in_block.end()), in_block.end());
  if (!std::equal(in_block.begin(), in_block.end(), held.listed().begin(), held.listed().end()))
    return broken("the list of a block is not what its cells list", where);
  return ok_status();
}

}  // namespace gridcast::tlas
