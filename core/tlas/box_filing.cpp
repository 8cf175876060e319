#include "core/tlas/box_filing.h"

#include <array>
#include <bit>
#include <new>
#include <type_traits>

#include "core/math/line_memory.h"

namespace gridcast::tlas {
namespace {

/// One number for each plane of a box, in the order of its memory: lower x, y, z, upper x, y, z.
using Planes = std::array<double, 6>;
static_assert(sizeof(Planes) == sizeof(Bounds3d) && sizeof(std::array<float, 6>) == sizeof(Bounds3f) &&
              sizeof(std::array<std::uint16_t, 6>) == sizeof(CellRange));
static_assert(std::is_trivially_copyable_v<BoxRecord>);

/// The layout by planes. All loops over planes are written so that compilers make vectors of them.
class PlanesOfLayout {
 public:
  explicit PlanesOfLayout(const GridLayout& layout) : layout_(layout) {
    for (std::size_t plane = 0; plane < 6; ++plane) {
      const auto axis = int(plane % 3);
      outward_[plane] = plane < 3 ? -1.0 : 1.0;
      border_[plane] = outward_[plane] * (plane < 3 ? layout.bounds.lower[axis] : layout.bounds.upper[axis]);
      origin_[plane] = layout.bounds.lower[axis];
      inverse_cell_[plane] = layout.inverse_cell[axis];
      last_cell_[plane] = double(layout.cells[axis] - 1);
      center_[plane] = layout.center[axis];
      rounding_[plane] = outward_[plane] * layout.outward;
    }
  }

  [[nodiscard]] BoxRecord record(const InstanceBox& box, std::uint32_t id) const {
    if (box.bounds.empty()) return {{}, id, {}};
    auto room = std::bit_cast<Planes>(box.bounds);
    const double pad = layout_.pad(box.drift);
    for (std::size_t plane = 0; plane < 6; ++plane) room[plane] += outward_[plane] * pad;
    bool inside = true;
    for (std::size_t plane = 0; plane < 6; ++plane) inside &= outward_[plane] * room[plane] <= border_[plane];
    if (!inside) return {{}, id, {}};

    std::array<std::uint16_t, 6> cells;
    std::array<float, 6> local;
    for (std::size_t plane = 0; plane < 6; ++plane) {
      double index = (room[plane] - origin_[plane]) * inverse_cell_[plane];
      index = index > 0.0 ? index : 0.0;
      index = index < last_cell_[plane] ? index : last_cell_[plane];
      cells[plane] = std::uint16_t(std::int32_t(index));
      local[plane] = float(room[plane] - center_[plane] + rounding_[plane]);
    }
    return {std::bit_cast<Bounds3f>(local), id, std::bit_cast<CellRange>(cells)};
  }

 private:
  const GridLayout& layout_;
  Planes outward_;  ///< -1 or 1
  Planes border_, origin_, inverse_cell_, last_cell_, center_, rounding_;
};

}  // namespace

RecordTable::RecordTable(std::size_t size)
    : records_(static_cast<BoxRecord*>(allocate_lines(size * sizeof(BoxRecord)))), size_(size) {}

RecordTable::~RecordTable() {
  free_lines(records_);
}

void write_records(const GridLayout& layout, std::span<const InstanceBox> boxes, std::uint32_t first_id,
                   BoxRecord* records) {
  const PlanesOfLayout planes(layout);
  for (std::size_t k = 0; k < boxes.size(); ++k)
    new (records + k) BoxRecord(planes.record(boxes[k], first_id + std::uint32_t(k)));
}

}  // namespace gridcast::tlas
