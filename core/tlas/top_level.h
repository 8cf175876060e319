#pragma once
// The top level: leads a world ray to the instances it can touch.

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/math/bounds.h"
#include "core/math/ray.h"
#include "core/tlas/instance_box.h"
#include "core/tlas/near_visitor.h"
#include "core/tlas/uniform_grid.h"
#include "core/tlas/world_ray.h"

namespace gridcast {
class RayWay;
}

namespace gridcast::tlas {

/// kNone: every box is tested by itself (none or one instance, or asked for). kOneLevel: all boxes side by
/// side, in one cell. kUniformGrid, and kNestedGrid where crowded cells have trees of their own.
enum class TopLevelKind : std::uint8_t { kNone, kOneLevel, kUniformGrid, kNestedGrid };
[[nodiscard]] std::string_view to_string(TopLevelKind kind);  ///< none, one_level, uniform_grid, nested_grid

struct TopLevelStats {
  TopLevelKind kind = TopLevelKind::kNone;
  std::string reason;  ///< why this kind and resolution, as a sentence
  std::uint32_t cells[3] = {0, 0, 0};
  Bounds3d bounds;
  std::size_t instance_count = 0;  ///< with a box, so reachable
  std::size_t cell_count = 0;
  std::size_t occupied_cells = 0;
  std::size_t tree_cells = 0;       ///< with so many instances that they have a tree
  std::size_t reference_count = 0;  ///< instances counted once per cell that lists them
  std::size_t max_references_in_cell = 0;
  std::size_t always_tested = 0;  ///< instances in no cell, tested for every ray
  double ray_cost =
      0.0;  ///< of a random line that meets the boxes, by the cost model and what the cells hold
  std::size_t memory_bytes = 0;
  double build_ms = 0.0;
};

/// kAuto follows the cost model; kNone never makes a grid (the reference that the grid is compared with).
enum class TopLevelChoice : std::uint8_t { kAuto, kNone };

/// A top level over the world boxes of instances. A value: copies share all memory, and a copy that is
/// updated copies only what changes. It knows no instance but by its id and its box.
///
/// No hit is lost: core/scene/hit_box.cpp shows that a hit lies in the instance's box grown by its drift,
/// GridLayout files the box with that room, GridWalk shows that the walk visits a cell of it. The answers are
/// thus the same whatever the structure, and whether it was updated or built anew.
class TopLevel {
 public:
  TopLevel() = default;
  /// boxes[i] is the box of instance i. Linear time, parallel.
  [[nodiscard]] static TopLevel build(BoxTable boxes, TopLevelChoice choice = TopLevelChoice::kAuto);
  [[nodiscard]] static TopLevel build(std::span<const InstanceBox> boxes,
                                      TopLevelChoice choice = TopLevelChoice::kAuto);
  /// Takes the boxes as they are now, of which only those of `changed` (ascending) differ or are new. Costs
  /// O(changes) and the blocks they touch. Built anew, in linear time, when half of the instances have
  /// changed since the last build, when the grid's memory bound or the number of boxes outside the grid is
  /// passed, or when the boxes fill less than half of the grid along an axis: that is looked at, in linear
  /// time too, when a 128th of the instances has changed. So the resolution follows where the instances are,
  /// and the changes pay for it.
  /// Where the boxes are spread about as they were when the layout of the grid was chosen, it keeps that
  /// layout, and the blocks of the new grid are made when somebody first looks at them.
  void update(BoxTable boxes, std::span<const std::uint32_t> changed);

  /// Calls `visit(instance_id)` once for every instance that can hold a hit in [ray.tnear, far], roughly
  /// from near to far. `visit` returns the largest t still of interest (the best t so far; -infinity ends
  /// the walk), which narrows `far`. `ray` is valid. Where `visit` has a member prefetch(instance_id), that
  /// is told of instances that are visited soon.
  template <class Visit>
  void traverse(const Ray& ray, double far, const Visit& visit) const {
    const auto call = [](const void* object, std::uint32_t id) -> double {
      return (*static_cast<const Visit*>(object))(id);
    };
    const auto prefetch = [](const void* object, std::uint32_t id) {
      if constexpr (requires(const Visit& v) { v.prefetch(id); })
        static_cast<const Visit*>(object)->prefetch(id);
    };
    traverse_all(ray, far, {&visit, call, prefetch});
  }

  /// traverse() for up to kGroupSize valid rays, ray i up to far[i]: `visitor.visit(instance_id, rays, far)`
  /// is called with a bit for each ray that can have a hit in the instance, at least one, and sets the far of
  /// these to the largest t still of interest. Every ray visits what it would visit alone; rays that come to
  /// an instance at the same time do so together. `visitor` also has finish, prefetch and goes_on: see
  /// GroupVisitor.
  template <class Visitor>
  void traverse_group(std::span<const Ray* const> rays, double* far, const Visitor& visitor) const {
    const auto visit = [](const void* object, std::uint32_t id, std::uint32_t bits, double* fars) {
      static_cast<const Visitor*>(object)->visit(id, bits, fars);
    };
    const auto finish = [](const void* object, double* fars) {
      static_cast<const Visitor*>(object)->finish(fars);
    };
    const auto prefetch = [](const void* object, std::uint32_t id) {
      static_cast<const Visitor*>(object)->prefetch(id);
    };
    const auto goes_on = [](const void* object) { return static_cast<const Visitor*>(object)->goes_on(); };
    traverse_group_all(rays, far, {&visitor, visit, finish, prefetch, goes_on});
  }

  /// What `traverse` does, told to `way`: the same visits in the same order, through the same cells. `visit`
  /// is also told where the ray enters the instance's box, if that was asked, and adds the instance's step.
  /// Ends early where `way` does.
  using ExplainVisit = std::function<double(std::uint32_t instance_id, std::optional<double> t_enter)>;
  void explain(const Ray& ray, double far, const ExplainVisit& visit, RayWay& way) const;

  /// Calls `visit(instance_id)` once for every instance whose box comes within `radius` of the point, roughly
  /// from near to far. `visit` returns the largest distance still of interest, which narrows the radius.
  template <class Visit>
  void search(const Vec3d& point, double radius, const Visit& visit) const {
    const auto call = [](const void* object, std::uint32_t id) -> double {
      return (*static_cast<const Visit*>(object))(id);
    };
    search_all(point, radius, {&visit, call});
  }

  [[nodiscard]] const Bounds3d& bounds() const { return bounds_; }  ///< holds every box
  [[nodiscard]] std::size_t slots() const { return boxes_.size(); }
  [[nodiscard]] const BoxTable& boxes() const { return boxes_; }
  [[nodiscard]] const InstanceBox& box(std::uint32_t instance_id) const { return boxes_[instance_id]; }
  /// The instance that `traverse` can visit, where there is no other.
  [[nodiscard]] std::optional<std::uint32_t> sole_instance() const {
    return !grid_ && always_.size() == 1 ? std::optional(always_.front()) : std::nullopt;
  }
  [[nodiscard]] TopLevelKind kind() const;
  [[nodiscard]] std::size_t memory_bytes() const;
  [[nodiscard]] TopLevelStats stats() const;  ///< looks at every cell
  /// Every box is listed in exactly the cells of its range, in the order of ids, and nothing else is.
  [[nodiscard]] Status validate() const;

 private:
  [[nodiscard]] bool worth_rebuilding(std::size_t changes) const;
  /// Brings bounds_ up to date; whether the boxes fill less than half of the grid along an axis.
  [[nodiscard]] bool shrunk();
  void replace(std::uint32_t id, const InstanceBox& old, std::vector<RangeChange>& range_changes);

  void traverse_all(const Ray& ray, double far, const InstanceVisitor& visitor) const;
  void traverse_group_all(std::span<const Ray* const> rays, double* far, const GroupVisitor& visitor) const;
  void search_all(const Vec3d& point, double radius, const NearVisitor& visitor) const;
  /// `moving` leaves room for instances that move on.
  void build_grid(bool moving);
  void list_always();
  /// Files all boxes in the layout that there is; whether that is still as good as a new one.
  [[nodiscard]] bool refile();

  BoxTable boxes_;
  std::optional<UniformGrid> grid_;
  std::vector<std::uint32_t> always_;  ///< ascending; all reachable instances when there is no grid
  Bounds3d bounds_;                    ///< union at the last build, extended since
  TopLevelChoice choice_ = TopLevelChoice::kAuto;
  std::size_t reachable_ = 0;            ///< instances with a box
  std::size_t changes_since_build_ = 0;  ///< boxes replaced or added
  std::size_t outside_at_build_ = 0;     ///< size of always_ then
  std::size_t changes_at_look_ = 0;      ///< changes_since_build_ when shrunk() was last asked
  FilingSummary at_choice_;              ///< when the layout was chosen
  bool has_room_ = false;                ///< the layout leaves room for instances that move on
  std::string reason_;
  double build_ms_ = 0.0;
};

}  // namespace gridcast::tlas
