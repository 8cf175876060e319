#include "core/tlas/block_source.h"

#include "core/tlas/block_builder.h"

namespace gridcast::tlas {

const GridBlock BlockSlot::kUnmade;

BlockSource::BlockSource(const GridLayout& layout, const BoxTable& boxes)
    : layout_(layout),
      shape_(layout),
      boxes_(boxes),
      lists_(std::in_place, layout, boxes),
      summary_(lists_->summary()) {}

void BlockSource::forget() {
  boxes_.reset();
  lists_.reset();
}

// Without other threads' help: a task that waits for others may be given a ray to trace, which may ask for
// this very block.
const GridBlock* BlockSlot::make(std::uint32_t index, const BlockSource& source) const {
  const std::lock_guard lock(source.making_[index % source.making_.size()]);
  const GridBlock* const block = block_.load(std::memory_order_acquire);
  if (block != &kUnmade) return block;
  BlockBuilder builder(source.layout(), source.shape(), source.boxes(), Helpers::kNone);
  owner_ = builder.make(index, source.listed(index));
  source.made_bytes_ += std::int64_t(owner_->memory_bytes());
  block_.store(owner_.get(), std::memory_order_release);
  return owner_.get();
}

}  // namespace gridcast::tlas
