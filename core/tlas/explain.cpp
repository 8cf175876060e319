// Walks that tell what TopLevel::traverse does, step by step: the same cells, the same visits in the same
// order. A cell's boxes are tested four or eight at a time, so what is passed over in a group is told before
// what is visited of it.

#include <algorithm>
#include <bit>
#include <optional>
#include <utility>
#include <vector>

#include "core/math/ray_way.h"
#include "core/tlas/block_search.h"
#include "core/tlas/cell_reader.h"
#include "core/tlas/grid_walk.h"
#include "core/tlas/kernel_steps.h"
#include "core/tlas/top_level.h"

namespace gridcast::tlas {
namespace {

using Visit = TopLevel::ExplainVisit;

bool pass_over(RayWay& way, std::uint32_t id, InstanceOutcome why,
               std::optional<double> t_enter = std::nullopt) {
  return way.add(InstanceStep{id, kInvalidId, why, t_enter, {}});
}

/// Tests a box by itself and visits the instance, or tells why not. `box_end` is the ray's tfar.
bool visit_alone(const WorldRay& ray, const InstanceBox& box, std::uint32_t id, double box_end, double& far,
                 const Visit& visit, RayWay& way) {
  const Span span = intersect_alone(ray, box, far);
  if (!span.empty()) {
    far = visit(id, span.enter);
    return way.goes_on();
  }
  const Span whole = intersect_alone(ray, box, box_end);
  if (whole.empty()) return pass_over(way, id, InstanceOutcome::kBoxMissed);
  return pass_over(way, id, InstanceOutcome::kBeyondBest, whole.enter);
}

std::uint32_t instances_in(const GridBlock::CellStart& cell) {
  std::uint32_t count = 0;
  const auto add = [&count](std::uint32_t, const Bounds3f&, std::uint32_t) { ++count; };
  CellReader(add).read(cell);
  return count;
}

/// UniformGrid::walk.
class CellsWalk {
 public:
  CellsWalk(const UniformGrid& grid, const WorldRay& world, double far, const Visit& visit, RayWay& way)
      : grid_(grid), walk_(grid.layout(), world, far), visit_(visit), way_(way), far_(far) {
    if (!walk_.done()) ray_.emplace(grid.layout(), world, walk_.start(), walk_.end());
  }

  void run() {
    while (!walk_.done() && walk_.t_enter() <= far_ && way_.goes_on()) {
      const GridBlock* block = grid_.block(walk_.block());
      if (block == nullptr) {
        ++skipped_blocks_;
        walk_.leave_block();
        continue;
      }
      do {
        if (!cell(*block)) return;
      } while (walk_.step() && walk_.t_enter() <= far_);
    }
  }

 private:
  template <std::size_t kSlots>
  static const BoxGroup<kSlots>& group_at(const std::byte* bytes) {
    const void* at = bytes;
    return *static_cast<const BoxGroup<kSlots>*>(at);
  }
  [[nodiscard]] double t_at(float s) const {
    return std::max(walk_.start(), ray_->start + double(s) / ray_->scale);
  }

  bool cell(const GridBlock& block) {
    CellStep step;
    const Cell at = walk_.cell();
    std::copy(at.begin(), at.end(), step.cell.begin());
    step.t_enter = walk_.t_enter();
    step.t_exit = walk_.t_exit();
    step.skipped_blocks = std::exchange(skipped_blocks_, 0U);
    const std::uint32_t local = walk_.local();
    if (!block.occupied(local)) return way_.add(step);
    const GridBlock::CellStart start = block.cell(local);
    step.content = start.kind == CellKind::kTree ? CellContent::kTree : CellContent::kList;
    step.instances = instances_in(start);
    return way_.add(step) && (start.kind == CellKind::kTree ? tree(start.groups) : list(start));
  }

  bool list(const GridBlock::CellStart& start) {
    const std::byte* at = start.groups;
    NextGroup next = start.kind == CellKind::kFour ? NextGroup::kFour : NextGroup::kEight;
    while (next != NextGroup::kNone) {
      const bool is_four = next == NextGroup::kFour;
      if (!(is_four ? group(group_at<4>(at)) : group(group_at<8>(at)))) return false;
      next = is_four ? group_at<4>(at).next : group_at<8>(at).next;
      at += is_four ? sizeof(BoxGroup<4>) : sizeof(BoxGroup<8>);
    }
    return true;
  }

  template <std::size_t kSlots>
  bool group(const BoxGroup<kSlots>& group) {
    GroupEntries entries;
    const std::uint32_t hits = enter_group(group, *ray_, far_, entries);
    return visit_slots(group, hits & ~std::uint32_t(group.seen[walk_.from()]), entries);
  }

  /// Tells of the instances that are passed over, then visits the others, nearest first, as long as they can
  /// matter.
  template <std::size_t kSlots>
  bool visit_slots(const BoxGroup<kSlots>& group, std::uint32_t hits, const GroupEntries& entries) {
    GroupEntries to_end;
    const std::uint32_t hits_to_end = enter_group(group, *ray_, ray_->end, to_end);
    for (std::size_t slot = 0; slot < kSlots; ++slot) {
      if (((hits >> slot) & 1U) != 0 || group.box(slot).empty()) continue;
      const std::uint32_t id = group.links[slot];
      const bool was_seen = ((group.seen[walk_.from()] >> slot) & 1U) != 0;
      const bool is_beyond = ((hits_to_end >> slot) & 1U) != 0;
      const bool goes_on = was_seen ? pass_over(way_, id, InstanceOutcome::kAlreadyTested)
                           : is_beyond
                               ? pass_over(way_, id, InstanceOutcome::kBeyondBest, t_at(to_end.s_enter[slot]))
                               : pass_over(way_, id, InstanceOutcome::kBoxMissed);
      if (!goes_on) return false;
    }
    return visit_nearest_first(group.links, hits, entries);
  }

  bool visit_nearest_first(const std::uint32_t* ids, std::uint32_t hits, const GroupEntries& entries) {
    const bool is_alone = std::has_single_bit(hits);
    while (hits != 0) {
      auto nearest = std::uint32_t(std::countr_zero(hits));
      for (std::uint32_t rest = hits & (hits - 1); rest != 0; rest &= rest - 1) {
        const auto slot = std::uint32_t(std::countr_zero(rest));
        if (entries.s_enter[slot] < entries.s_enter[nearest]) nearest = slot;
      }
      hits &= ~(1U << nearest);
      const double t_enter = t_at(entries.s_enter[nearest]);
      if (!is_alone && entries.s_enter[nearest] > ray_->s_far(far_)) {
        if (!pass_over(way_, ids[nearest], InstanceOutcome::kBeyondBest, t_enter)) return false;
        continue;
      }
      far_ = visit_(ids[nearest], t_enter);
      if (!way_.goes_on()) return false;
    }
    return true;
  }

  struct Waiting {
    float s_enter;
    std::uint32_t link;
    std::uint32_t depth;

    [[nodiscard]] bool comes_before(const Waiting& other) const {
      const std::int32_t a = order_of(s_enter), b = order_of(other.s_enter);
      return a != b ? a < b : link < other.link;
    }
    /// The bits, made to compare like the floats, -0 before +0.
    static std::int32_t order_of(float s) {
      const auto bits = std::bit_cast<std::int32_t>(s);
      return bits ^ ((bits >> 31) & 0x7FFFFFFF);
    }
  };

  bool tree(const std::byte* groups) {
    std::vector<Waiting> stack{{ray_->s_near, 0, 0}};
    for (bool is_root = true; !stack.empty(); is_root = false) {
      const Waiting next = stack.back();
      stack.pop_back();
      if (!is_root && Waiting::order_of(next.s_enter) > Waiting::order_of(ray_->s_far(far_))) continue;
      const auto& group =
          group_at<8>(groups + std::size_t(tree_link::index(next.link)) * sizeof(BoxGroup<8>));
      GroupEntries entries;
      const std::uint32_t hits =
          enter_group(group, *ray_, far_, entries) & ~std::uint32_t(group.seen[walk_.from()]);
      const bool is_leaf = tree_link::is_leaf(next.link);
      if (!is_leaf) push(stack, group, hits, entries, next.depth + 1);
      if (!way_.add(cell_node(group, next, hits, stack.size()))) return false;
      if (is_leaf && !visit_slots(group, hits, entries)) return false;
    }
    return true;
  }

  [[nodiscard]] CellNodeStep cell_node(const BoxGroup<8>& group, const Waiting& node, std::uint32_t hits,
                                       std::size_t stack) const {
    CellNodeStep step;
    step.depth = node.depth;
    step.t_enter = t_at(node.s_enter);
    for (std::size_t slot = 0; slot < 8; ++slot) step.children += group.box(slot).empty() ? 0U : 1U;
    step.children_hit = std::uint32_t(std::popcount(hits));
    step.stack = std::uint32_t(stack);
    return step;
  }

  static void push(std::vector<Waiting>& stack, const BoxGroup<8>& group, std::uint32_t hits,
                   const GroupEntries& entries, std::uint32_t depth) {
    const std::size_t bottom = stack.size();
    for (; hits != 0; hits &= hits - 1) {
      const auto slot = std::uint32_t(std::countr_zero(hits));
      const Waiting child{entries.s_enter[slot], group.links[slot], depth};
      const auto place = std::find_if(stack.begin() + std::ptrdiff_t(bottom), stack.end(),
                                      [&](const Waiting& one) { return one.comes_before(child); });
      stack.insert(place, child);
    }
  }

  const UniformGrid& grid_;
  GridWalk walk_;
  std::optional<GridRay> ray_;
  const Visit& visit_;
  RayWay& way_;
  double far_;
  std::uint32_t skipped_blocks_ = 0;
};

/// UniformGrid::search.
struct BlocksWalk {
  const GridLayout& layout;
  const BoxTable& boxes;
  const WorldRay& ray;
  double ray_end;
  double t_far;
  const Visit& visit;
  RayWay& way;
  std::uint32_t skipped_blocks = 0;

  [[nodiscard]] double far() const { return t_far; }
  bool test(const Cell& block, const Span& span, const GridBlock* held) {
    if (held == nullptr) {
      ++skipped_blocks;
      return way.goes_on();
    }
    BlockStep step{{block[0], block[1], block[2]},
                   span.enter,
                   span.exit,
                   std::uint32_t(held->listed().size()),
                   std::exchange(skipped_blocks, 0U)};
    if (!way.add(step)) return false;
    for (const std::uint32_t id : held->listed()) {
      const Span own = intersect_alone(ray, boxes[id], t_far);
      const bool elsewhere = !own.empty() && block_to_test_in(layout, ray, boxes[id], own.enter) != block;
      if (!(elsewhere ? pass_over(way, id, InstanceOutcome::kOtherBlock, own.enter)
                      : visit_alone(ray, boxes[id], id, ray_end, t_far, visit, way)))
        return false;
    }
    return true;
  }
};

}  // namespace

void TopLevel::explain(const Ray& ray, double far, const ExplainVisit& visit, RayWay& way) const {
  if (const std::optional<std::uint32_t> sole = sole_instance()) {
    if (way.goes_on()) visit(*sole, std::nullopt);
    return;
  }
  const WorldRay world(ray);
  const double ray_end = far;
  for (const std::uint32_t id : always_)
    if (!visit_alone(world, boxes_[id], id, ray_end, far, visit, way)) return;
  if (!grid_) return;
  if (world.distance_to(grid_->layout().bounds) <= grid_->layout().reach) {
    CellsWalk(*grid_, world, far, visit, way).run();
  } else {
    BlocksWalk blocks{grid_->layout(), boxes_, world, ray_end, far, visit, way};
    BlockSearch(*grid_, world, blocks).run();
  }
}

}  // namespace gridcast::tlas
