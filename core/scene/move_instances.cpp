// Many moves at once: transforms and boxes are made eight by eight, and a chunk of slots that move all is
// written without being copied first.

#include <algorithm>
#include <atomic>
#include <limits>

#include "core/scene/chunk_parts.h"
#include "core/scene/hit_box_batch.h"
#include "core/scene/scene_editor.h"

namespace gridcast::scene {
namespace {

using Instances = ChunkedVector<Instance, 32>;
static_assert(kSlotsOfOneTask % Instances::kChunkSize == 0);

/// Makes the chunk of element `id` this vector's own, for `count` of its elements to be written.
template <class Vector>
void own_chunk(Vector& vector, std::size_t id, std::size_t count) {
  if (count == Vector::kChunkSize) {
    vector.overwrite_chunk(id);
  } else {
    (void)vector.write(id);
  }
}

/// The moves by id.
class SortedMoves {
 public:
  explicit SortedMoves(std::span<const MoveInstance> moves) : moves_(moves) {
    const auto ascending = [](const MoveInstance& a, const MoveInstance& b) {
      return a.instance_id < b.instance_id;
    };
    if (std::is_sorted(moves.begin(), moves.end(), ascending)) return;
    order_.resize(moves.size());
    for (std::size_t k = 0; k < moves.size(); ++k)
      order_[k] = (std::uint64_t(moves[k].instance_id) << 32) | std::uint64_t(k);
    std::sort(order_.begin(), order_.end());
  }

  [[nodiscard]] std::size_t size() const { return moves_.size(); }
  /// Where the k-th by id is among the moves as given.
  [[nodiscard]] std::size_t place(std::size_t k) const {
    return order_.empty() ? k : std::uint32_t(order_[k]);
  }
  [[nodiscard]] const MoveInstance& operator[](std::size_t k) const { return moves_[place(k)]; }
  [[nodiscard]] std::uint32_t id(std::size_t k) const {
    return order_.empty() ? moves_[k].instance_id : std::uint32_t(order_[k] >> 32);
  }
  [[nodiscard]] bool repeated(std::size_t k) const { return k > 0 && id(k) == id(k - 1); }

 private:
  std::span<const MoveInstance> moves_;
  std::vector<std::uint64_t> order_;  ///< id and place; empty where the moves come by id
};

/// Writes the slots of some of the moves.
class Mover {
 public:
  Mover(const SortedMoves& moves, const std::vector<MeshHull>& hulls, Instances& instances,
        tlas::BoxTable& boxes, std::atomic<std::size_t>& first_wrong)
      : moves_(moves), hulls_(hulls), instances_(instances), boxes_(boxes), first_wrong_(first_wrong) {}

  void run(std::size_t begin, std::size_t end) {
    for_each_chunk<tlas::BoxTable::kChunkSize>(begin, end, [&](std::size_t first, std::size_t last) {
      if (moves_.id(first) < boxes_.size()) own_chunk(boxes_, moves_.id(first), last - first);
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
    bool sound = true;
    for (std::size_t k = begin; k < end; ++k) {
      const std::uint32_t id = moves_.id(k);
      if (id >= instances_.size() || !instances_[id].alive || moves_.repeated(k)) {
        note_wrong(k);
        sound = false;
      } else {
        kept_[k - begin] = {instances_[id].mesh_id, instances_[id].mask};
      }
    }
    if (!sound) return;
    own_chunk(instances_, moves_.id(begin), end - begin);
    for (std::size_t k = begin; k < end; k += TransformBatch::kSize)
      move_eight(k, std::min(TransformBatch::kSize, end - k), kept_ + (k - begin));
  }

  void move_eight(std::size_t begin, std::size_t count, const Kept* kept) {
    HullLanes hulls;
    hulls.fill(&hulls_[kept[0].mesh_id]);
    for (std::size_t lane = 0; lane < count; ++lane) {
      batch_.set(lane, moves_[begin + lane].world_from_object);
      hulls[lane] = &hulls_[kept[lane].mesh_id];
    }
    batch_.invert();
    hit_boxes(batch_, hulls, box_lanes_);
    for (std::size_t lane = 0; lane < count; ++lane) {
      const std::uint32_t id = moves_.id(begin + lane);
      if (((batch_.active() >> lane) & 1U) == 0) note_wrong(begin + lane);
      Instance& instance = instances_.write(id);
      batch_.get(lane, instance.transform);
      instance.mesh_id = kept[lane].mesh_id;
      instance.alive = true;
      instance.mask = kept[lane].mask;
      boxes_.write(id) = hulls[lane]->empty() ? tlas::InstanceBox{} : box_lanes_.box(lane);
    }
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
  const std::size_t before = moved_.size();
  moved_.resize(before + moves.size());
  for (std::size_t k = 0; k < moves.size(); ++k) moved_[before + k] = sorted.id(k);
  return ok_status();
}

}  // namespace gridcast::scene
