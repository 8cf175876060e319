#include "core/tlas/grid_block.h"

#include <cstring>
#include <new>

#include "core/math/line_memory.h"

namespace gridcast::tlas {
namespace {

std::size_t lines_for(std::size_t bytes) {
  return (bytes + GridBlock::kLineBytes - 1) / GridBlock::kLineBytes;
}

}  // namespace

std::shared_ptr<GridBlock> GridBlock::allocate(std::uint64_t occupied, std::size_t group_lines,
                                               std::span<const std::uint32_t> listed,
                                               std::uint32_t references, std::uint32_t trees) {
  const std::size_t starts_bytes = std::size_t(std::popcount(occupied)) * sizeof(std::uint32_t);
  const std::size_t head = lines_for(kStartsOffset + starts_bytes);
  const std::size_t total = head + group_lines + lines_for(listed.size_bytes());
  auto* block = new (allocate_lines(total * kLineBytes)) GridBlock;
  std::shared_ptr<GridBlock> owner(block, [](GridBlock* held) { free_lines(held); });
  block->occupied_ = occupied;
  block->listed_line_ = std::uint32_t(head + group_lines);
  block->listed_count_ = std::uint32_t(listed.size());
  block->line_count_ = std::uint32_t(total);
  block->reference_count_ = references;
  block->tree_count_ = trees;
  std::memcpy(block->bytes() + std::size_t(block->listed_line_) * kLineBytes, listed.data(),
              listed.size_bytes());
  return owner;
}

void GridBlock::set_start(std::size_t rank, std::size_t line, CellKind kind) {
  const std::uint32_t start = std::uint32_t(line << 2) | std::uint32_t(kind);
  std::memcpy(bytes() + kStartsOffset + rank * sizeof start, &start, sizeof start);
}

std::size_t GridBlock::lines_of(std::uint32_t local) const {
  const std::uint64_t later = occupied_ & (~std::uint64_t(1) << local);
  const std::byte* const end = later == 0 ? bytes() + std::size_t(listed_line_) * kLineBytes
                                          : cell(std::uint32_t(std::countr_zero(later))).groups;
  return std::size_t(end - cell(local).groups) / kLineBytes;
}

std::size_t GridBlock::first_group_line() const {
  return lines_for(kStartsOffset + std::size_t(std::popcount(occupied_)) * sizeof(std::uint32_t));
}

}  // namespace gridcast::tlas
