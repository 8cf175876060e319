// Many moves at once: transforms and boxes are made eight by eight, and a chunk of slots that move all is
// written without being copied first.

#include <algorithm>
#include <atomic>
#include <bit>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/scene/chunk_parts.h"
#include "core/scene/place_batch.h"
#include "core/scene/scene_editor.h"

namespace gridcast::scene {
namespace {

using Transforms = InstanceTable::Transforms;
static_assert(kSlotsOfOneTask % Transforms::kChunkSize == 0);

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

/// The chunk of element `id` as this vector's own, for `count` of its elements to be written.
template <class Vector>
auto own_chunk(Vector& vector, std::size_t id, std::size_t count) {
  return count == Vector::kChunkSize ? vector.overwrite_chunk(id) : vector.write_chunk(id);
}

/// Moves by id: as they come, or sorted first.
class OrderedMoves {
 public:
  explicit OrderedMoves(std::span<const MoveInstance> moves) : moves_(moves) {}

  /// Keeps the first of each instance; returns the least place of one that is left out, or kNone.
  [[nodiscard]] std::size_t sort() {
    order_.resize(moves_.size());
    for (std::size_t k = 0; k < moves_.size(); ++k)
      order_[k] = (std::uint64_t(moves_[k].instance_id) << 32) | std::uint64_t(k);
    std::sort(order_.begin(), order_.end());
    std::size_t first_repeated = kNone, kept = 1;
    for (std::size_t k = 1; k < order_.size(); ++k) {
      if (id(k) == id(kept - 1)) {
        first_repeated = std::min(first_repeated, place(k));
      } else {
        order_[kept++] = order_[k];
      }
    }
    order_.resize(kept);
    return first_repeated;
  }

  [[nodiscard]] std::size_t size() const { return order_.empty() ? moves_.size() : order_.size(); }
  /// Where the k-th is among the moves as given.
  [[nodiscard]] std::size_t place(std::size_t k) const {
    return order_.empty() ? k : std::uint32_t(order_[k]);
  }
  [[nodiscard]] const MoveInstance& operator[](std::size_t k) const { return moves_[place(k)]; }
  [[nodiscard]] std::uint32_t id(std::size_t k) const {
    return order_.empty() ? moves_[k].instance_id : std::uint32_t(order_[k] >> 32);
  }

 private:
  std::span<const MoveInstance> moves_;
  std::vector<std::uint64_t> order_;  ///< id and place; empty where the moves are taken as they come
};

/// What came of some moves.
struct MoveOutcome {
  std::vector<std::uint32_t> ids;  ///< of all, in their order
  /// Where the first that is wrong is among the moves as given.
  std::atomic<std::size_t> first_wrong = kNone;
  std::atomic<bool> ascending = true;  ///< whether the ids are, each once; without it nothing else counts
};

/// Writes where some of the moves lead.
class Mover {
  static constexpr std::size_t kChunk = Transforms::kChunkSize;
  /// Moves asked for before they are read.
  static constexpr std::size_t kMovesAhead = 64;

 public:
  Mover(const OrderedMoves& moves, const Scene& scene, InstanceTable& instances, tlas::BoxTable& boxes,
        MoveOutcome& outcome)
      : moves_(moves), scene_(scene), instances_(instances), boxes_(boxes), outcome_(outcome) {}

  /// Moves [begin, end), if their ids ascend and are below `limit`. Writes to no chunk but of these.
  void run(std::size_t begin, std::size_t end, std::uint64_t limit) {
    while (begin < end) {
      const std::size_t next = end_of_chunk(begin, end, limit);
      if (next == begin) outcome_.ascending = false;
      if (!outcome_.ascending) return;
      move_chunk(begin, next);
      begin = next;
    }
  }

 private:
  /// Where the moves of the chunk of the boxes that `begin` is of end; `begin` itself where the ids do not
  /// ascend or reach the limit. Notes the ids.
  std::size_t end_of_chunk(std::size_t begin, std::size_t end, std::uint64_t limit) const {
    constexpr std::size_t kBoxes = tlas::BoxTable::kChunkSize;
    const std::size_t chunk = moves_.id(begin) / kBoxes;
    std::uint64_t least = 0;
    std::size_t k = begin;
    for (; k < end; ++k) {
      const std::uint32_t id = moves_.id(k);
      if (id < least || id >= limit) return begin;
      if (id / kBoxes != chunk) break;
      outcome_.ids[k] = id;
      least = std::uint64_t(id) + 1;
    }
    return k;
  }

  /// Moves [begin, end), all of one chunk of the boxes.
  void move_chunk(std::size_t begin, std::size_t end) {
    const std::uint32_t* const ids = outcome_.ids.data();
    bool sound = true;
    for (std::size_t k = begin; k < end; ++k) {
      if (ids[k] < instances_.size() && instances_.slot(ids[k]).alive) continue;
      note_wrong(k);
      sound = false;
    }
    if (!sound) return;
    boxes_of_chunk_ = own_chunk(boxes_, ids[begin], end - begin).data();
    while (begin < end) {
      std::size_t next = begin + 1;
      while (next < end && ids[next] / kChunk == ids[begin] / kChunk) ++next;
      transforms_of_chunk_ = own_chunk(instances_.transforms(), ids[begin], next - begin).data();
      place_all(begin, next);
      begin = next;
    }
  }

  /// Moves [begin, end), all of one chunk of the transforms, eight by eight.
  void place_all(std::size_t begin, std::size_t end) {
    const std::uint32_t* const ids = outcome_.ids.data();
    for (std::size_t k = begin; k < std::min(begin + PlaceBatch::kSize, end); ++k) ask_to_write(ids[k]);
    for (std::size_t k = begin; k < end; ++k) {
      if (k + PlaceBatch::kSize < end) ask_to_write(ids[k + PlaceBatch::kSize]);
      ask_to_read(k + kMovesAhead);
      batch_.add(moves_[k].world_from_object, scene_.hull(instances_.slot(ids[k]).mesh_id), transform(ids[k]),
                 box(ids[k]));
      if (batch_.size() == PlaceBatch::kSize || k + 1 == end) place(k + 1);
    }
  }

  /// What the batch holds, the moves up to `end`.
  void place(std::size_t end) {
    const std::size_t count = batch_.size();
    const std::uint32_t wrong = ~batch_.place() & ((1U << count) - 1U);
    for (std::uint32_t rest = wrong; rest != 0; rest &= rest - 1)
      note_wrong(end - count + std::size_t(std::countr_zero(rest)));
    batch_.clear();
  }

  [[nodiscard]] InstanceTransform& transform(std::uint32_t id) const {
    return transforms_of_chunk_[id % kChunk];
  }
  [[nodiscard]] tlas::InstanceBox& box(std::uint32_t id) const {
    return boxes_of_chunk_[id % tlas::BoxTable::kChunkSize];
  }

  // Both are inlined early, since GCC takes a function that only asks for memory to do nothing and leaves it
  // out.
  // Three times a move of 104 bytes, or every other line in the middle of one is missed.
  [[gnu::always_inline]] void ask_to_read(std::size_t k) const {
    if (k >= moves_.size()) return;
    const MoveInstance& move = moves_[k];
    __builtin_prefetch(&move);
    __builtin_prefetch(&move.world_from_object.linear[1][2]);
    __builtin_prefetch(&move.world_from_object.translation.z);
  }
  [[gnu::always_inline]] void ask_to_write(std::uint32_t id) const {
    constexpr int kToWrite = 1;
    __builtin_prefetch(&transform(id), kToWrite);
    __builtin_prefetch(&transform(id).world_from_object().linear[2][2], kToWrite);
    __builtin_prefetch(&transform(id).object_from_world_linear()[1], kToWrite);
    __builtin_prefetch(&box(id), kToWrite);
  }

  void note_wrong(std::size_t k) {
    const std::size_t place = moves_.place(k);
    std::size_t first = outcome_.first_wrong;
    while (place < first && !outcome_.first_wrong.compare_exchange_weak(first, place)) {
    }
  }

  const OrderedMoves& moves_;
  const Scene& scene_;
  InstanceTable& instances_;
  tlas::BoxTable& boxes_;
  MoveOutcome& outcome_;
  InstanceTransform* transforms_of_chunk_ = nullptr;  ///< that is being written
  tlas::InstanceBox* boxes_of_chunk_ = nullptr;
  PlaceBatch batch_;
};

/// Whether the ids ascend comes out on the way, since asking first would be a pass over all of the moves.
void move_in_order(const OrderedMoves& moves, const Scene& scene, InstanceTable& instances,
                   tlas::BoxTable& boxes, MoveOutcome& outcome) {
  const std::vector<std::size_t> borders =
      part_borders(moves.size(), [&](std::size_t k) { return moves.id(k); });
  for (std::size_t part = 2; part + 1 < borders.size() && outcome.ascending; ++part)
    outcome.ascending = moves.id(borders[part - 1]) < moves.id(borders[part]);
  if (!outcome.ascending) return;
  for_each_part(borders, [&](std::size_t begin, std::size_t end) {
    const std::uint64_t limit = end < moves.size() ? moves.id(end) : std::uint64_t(kInvalidId) + 1;
    Mover(moves, scene, instances, boxes, outcome).run(begin, end, limit);
  });
}

Error why_wrong(const Scene& scene, std::span<const MoveInstance> moves, std::size_t place) {
  const std::uint32_t id = moves[place].instance_id;
  std::string where = "/";
  where += std::to_string(place);
  if (!scene.find_instance(id))
    return {ErrorCode::kNotFound, "there is no instance " + std::to_string(id), where + "/instance_id"};
  const auto same = [&](const MoveInstance& other) { return other.instance_id == id; };
  if (std::ranges::any_of(moves.first(place), same))
    return {ErrorCode::kInvalidArgument, "this instance is moved twice", where + "/instance_id"};
  return singular_transform(where + "/world_from_object");
}

}  // namespace

Status SceneEditor::move_instances(std::span<const MoveInstance> moves) {
  if (moves.empty()) return ok_status();
  OrderedMoves ordered(moves);
  MoveOutcome outcome;
  outcome.ids.resize(moves.size());
  move_in_order(ordered, *scene_, scene_->instances_, boxes(), outcome);
  if (!outcome.ascending) {
    // What was written is written again, since it is the same instances that move.
    outcome.ascending = true;
    outcome.first_wrong = ordered.sort();
    move_in_order(ordered, *scene_, scene_->instances_, boxes(), outcome);
  }
  if (outcome.first_wrong != kNone) return why_wrong(scene(), moves, outcome.first_wrong);
  if (moved_.empty()) {
    moved_ = std::move(outcome.ids);
  } else {
    moved_.insert(moved_.end(), outcome.ids.begin(), outcome.ids.end());
  }
  return ok_status();
}

}  // namespace gridcast::scene
