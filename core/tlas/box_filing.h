#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "core/tlas/box_record.h"

namespace gridcast::tlas {

/// The records of boxes, by id, each written once. Memory that is not written first: it is as large as the
/// boxes themselves.
class RecordTable {
 public:
  explicit RecordTable(std::size_t size);
  ~RecordTable();
  RecordTable(const RecordTable&) = delete;
  RecordTable& operator=(const RecordTable&) = delete;

  [[nodiscard]] BoxRecord* at(std::size_t id) { return records_ + id; }
  [[nodiscard]] std::span<const BoxRecord> records() const { return {records_, size_}; }

 private:
  BoxRecord* records_;
  std::size_t size_;
};

/// Writes the records of boxes[0], boxes[1], ..., of instances first_id, first_id + 1, ...:
/// GridLayout::range_of and local_box bit for bit. The box of a record with an empty range means nothing.
void write_records(const GridLayout& layout, std::span<const InstanceBox> boxes, std::uint32_t first_id,
                   BoxRecord* records);

}  // namespace gridcast::tlas
