// Many moves at once: transforms and boxes are made eight by eight, and a chunk of slots that move all is
// written without being copied first.

#include <algorithm>
#include <atomic>
#include <limits>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/scene/chunk_parts.h"
#include "core/scene/hit_box_batch.h"
#include "core/scene/scene_editor.h"

namespace gridcast::scene {
namespace {

using Instances = ChunkedVector<Instance, 32>;
static_assert(kSlotsOfOneTask % Instances::kChunkSize == 0);

/// The chunk of element `id` as this vector's own, for `count` of its elements to be written.
template <class Vector>
auto own_chunk(Vector& vector, std::size_t id, std::size_t count) {
  return count == Vector::kChunkSize ? vector.overwrite_chunk(id) : vector.write_chunk(id);
}

/// The moves by id. The ids are looked at time and again, so they are kept apart from the large moves.
class SortedMoves {
 public:
  explicit SortedMoves(std::span<const MoveInstance> moves) : moves_(moves), ids_(moves.size()) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, moves.size(), 4096), [&](const auto& part) {
      for (std::size_t k = part.begin(); k < part.end(); ++k) ids_[k] = moves[k].instance_id;
    });
    if (std::is_sorted(ids_.begin(), ids_.end())) return;
    order_.resize(moves.size());
    for (std::size_t k = 0; k < moves.size(); ++k)
      order_[k] = (std::uint64_t(moves[k].instance_id) << 32) | std::uint64_t(k);
    std::sort(order_.begin(), order_.end());
    for (std::size_t k = 0; k < moves.size(); ++k) ids_[k] = std::uint32_t(order_[k] >> 32);
  }

  [[nodiscard]] std::size_t size() const { return moves_.size(); }
  /// Where the k-th by id is among the moves as given.
  [[nodiscard]] std::size_t place(std::size_t k) const {
    return order_.empty() ? k : std::uint32_t(order_[k]);
  }
  [[nodiscard]] const MoveInstance& operator[](std::size_t k) const { return moves_[place(k)]; }
  [[nodiscard]] std::uint32_t id(std::size_t k) const { return ids_[k]; }
  [[nodiscard]] const std::vector<std::uint32_t>& ids() const { return ids_; }
  [[nodiscard]] bool repeated(std::size_t k) const { return k > 0 && id(k) == id(k - 1); }

 private:
  std::span<const MoveInstance> moves_;
  std::vector<std::uint32_t> ids_;    ///< ascending
  std::vector<std::uint64_t> order_;  ///< id and place; empty where the moves come by id
};

/// Writes the slots of some of the moves.
class Mover {
 public:
  Mover(const SortedMoves& moves, const std::vector<MeshHull>& hulls, Instances& instances,
        tlas::BoxTable& boxes, std::atomic<std::size_t>& first_wrong)
      : moves_(moves), hulls_(hulls), instances_(instances), boxes_(boxes), first_wrong_(first_wrong) {}

  void run(std::size_t begin, std::size_t end) {
    end_ = end;
    for_each_chunk<tlas::BoxTable::kChunkSize>(begin, end, [&](std::size_t first, std::size_t last) {
      if (moves_.id(first) < boxes_.size())
        box_chunk_ = own_chunk(boxes_, moves_.id(first), last - first).data();
      for_each_chunk<Instances::kChunkSize>(first, last,
                                            [&](std::size_t f, std::size_t l) { move_chunk(f, l); });
    });
  }

 private:
  /// What of an instance stays.
  struct Kept {
    std::uint32_t mesh_id = kInvalidId;
    InstanceMask mask = kFullMask;
  };

  template <std::size_t kChunk, class Visit>
  void for_each_chunk(std::size_t begin, std::size_t end, const Visit& visit) const {
    while (begin < end) {
      const std::size_t chunk = moves_.id(begin) / kChunk;
      std::size_t next = begin + 1;
      while (next < end && moves_.id(next) / kChunk == chunk) ++next;
      visit(begin, next);
      begin = next;
    }
  }

  /// Moves [begin, end), all of one chunk of the instances.
  void move_chunk(std::size_t begin, std::size_t end) {
    // What stays of each, before the chunk is written.
    const std::uint32_t first = moves_.id(begin);
    const Instance* const old = first < instances_.size() ? instances_.chunk(first).data() : nullptr;
    bool sound = true;
    for (std::size_t k = begin; k < end; ++k) {
      const std::uint32_t id = moves_.id(k);
      const Instance* const slot = id < instances_.size() ? &old[id % Instances::kChunkSize] : nullptr;
      if (slot == nullptr || !slot->alive || moves_.repeated(k)) {
        note_wrong(k);
        sound = false;
      } else {
        kept_[k - begin] = {slot->mesh_id, slot->mask};
      }
    }
    ask_for(end);
    if (!sound) return;
    end_of_chunk_ = end;
    chunk_ = own_chunk(instances_, first, end - begin).data();
    for (std::size_t k = begin; k < std::min(begin + TransformBatch::kSize, end); ++k) ask_to_write(k);
    for (std::size_t k = begin; k < end; k += TransformBatch::kSize)
      move_eight(k, std::min(TransformBatch::kSize, end - k), kept_ + (k - begin));
  }

  // Both are inlined early, since GCC takes a function that only asks for memory to do nothing and leaves it
  // out.
  /// Of the moves from `begin` on and their slots as they are, as far as these are in one chunk. Not beyond
  /// this run: the chunks there are another thread's to write.
  [[gnu::always_inline]] void ask_for(std::size_t begin) const {
    if (begin >= end_ || moves_.id(begin) >= instances_.size()) return;
    const std::size_t end = std::min(begin + Instances::kChunkSize, end_);
    const Instance* const slots = instances_.chunk(moves_.id(begin)).data();
    for (std::size_t k = begin; k < end; ++k) {
      const MoveInstance& move = moves_[k];
      __builtin_prefetch(&move.world_from_object);
      __builtin_prefetch(&move.world_from_object.translation);
      __builtin_prefetch(&slots[moves_.id(k) % Instances::kChunkSize].mesh_id);
    }
  }
  /// Of a slot as it becomes and its box, which lie in the chunks that are being written.
  [[gnu::always_inline]] void ask_to_write(std::size_t k) const {
    const std::uint32_t id = moves_.id(k);
    const Instance& instance = chunk_[id % Instances::kChunkSize];
    constexpr int kToWrite = 1;
    __builtin_prefetch(&instance.transform, kToWrite);
    __builtin_prefetch(&instance.transform.world_from_object().linear[2][2], kToWrite);
    __builtin_prefetch(&instance.transform.object_from_world_linear()[1], kToWrite);
    __builtin_prefetch(&instance.mesh_id, kToWrite);
    __builtin_prefetch(&box_chunk_[id % tlas::BoxTable::kChunkSize], kToWrite);
  }

  void move_eight(std::size_t begin, std::size_t count, const Kept* kept) {
    HullLanes hulls;
    hulls.fill(&hulls_[kept[0].mesh_id]);
    for (std::size_t lane = 0; lane < count; ++lane) {
      if (begin + lane + TransformBatch::kSize < end_of_chunk_)
        ask_to_write(begin + lane + TransformBatch::kSize);
      batch_.set(lane, moves_[begin + lane].world_from_object);
      hulls[lane] = &hulls_[kept[lane].mesh_id];
    }
    batch_.invert();
    hit_boxes(batch_, hulls, box_lanes_);
    InstanceTransform* transforms[TransformBatch::kSize];
    for (std::size_t lane = 0; lane < count; ++lane) {
      const std::uint32_t id = moves_.id(begin + lane);
      if (((batch_.active() >> lane) & 1U) == 0) note_wrong(begin + lane);
      Instance& instance = chunk_[id % Instances::kChunkSize];
      transforms[lane] = &instance.transform;
      instance.mesh_id = kept[lane].mesh_id;
      instance.alive = true;
      instance.mask = kept[lane].mask;
      box_chunk_[id % tlas::BoxTable::kChunkSize] =
          hulls[lane]->empty() ? tlas::InstanceBox{} : box_lanes_.box(lane);
    }
    batch_.get({transforms, count});
  }

  void note_wrong(std::size_t k) {
    const std::size_t place = moves_.place(k);
    std::size_t first = first_wrong_;
    while (place < first && !first_wrong_.compare_exchange_weak(first, place)) {
    }
  }

  const SortedMoves& moves_;
  const std::vector<MeshHull>& hulls_;
  Instances& instances_;
  tlas::BoxTable& boxes_;
  std::atomic<std::size_t>& first_wrong_;
  tlas::InstanceBox* box_chunk_ = nullptr;  ///< that are being written
  Instance* chunk_ = nullptr;
  std::size_t end_ = 0;           ///< of this run of moves
  std::size_t end_of_chunk_ = 0;  ///< of its moves
  TransformBatch batch_;
  BoxLanes box_lanes_{};
  Kept kept_[Instances::kChunkSize] = {};
};

Error why_wrong(const Scene& scene, std::span<const MoveInstance> moves, std::size_t place) {
  const std::uint32_t id = moves[place].instance_id;
  std::string where = "/";
  where += std::to_string(place);
  if (scene.find_instance(id) == nullptr)
    return {ErrorCode::kNotFound, "there is no instance " + std::to_string(id), where + "/instance_id"};
  const auto same = [&](const MoveInstance& other) { return other.instance_id == id; };
  if (std::ranges::any_of(moves.first(place), same))
    return {ErrorCode::kInvalidArgument, "this instance is moved twice", where + "/instance_id"};
  return singular_transform(where + "/world_from_object");
}

}  // namespace

Status SceneEditor::move_instances(std::span<const MoveInstance> moves) {
  if (moves.empty()) return ok_status();
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  const SortedMoves sorted(moves);
  tlas::BoxTable& boxes = this->boxes();
  std::atomic<std::size_t> first_wrong = kNone;
  for_each_part(
      sorted.size(), [&](std::size_t k) { return sorted.id(k); },
      [&](std::size_t begin, std::size_t end) {
        Mover(sorted, scene_->hulls_, scene_->instances_, boxes, first_wrong).run(begin, end);
      });
  if (first_wrong != kNone) return why_wrong(scene(), moves, first_wrong);
  moved_.insert(moved_.end(), sorted.ids().begin(), sorted.ids().end());
  return ok_status();
}

}  // namespace gridcast::scene
