#pragma once
// The top level: leads a world ray to the instances it can touch.

#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/math/bounds.h"
#include "core/math/chunked_vector.h"
#include "core/math/ray.h"
#include "core/tlas/instance_box.h"
#include "core/tlas/world_ray.h"

namespace gridcast::tlas {

/// kNone: no structure, every instance box is tested (a scene of one or a few instances needs no grid).
enum class TopLevelKind : std::uint8_t { kNone, kUniformGrid };
[[nodiscard]] std::string_view to_string(TopLevelKind kind);  ///< none, uniform_grid

struct TopLevelStats {
  TopLevelKind kind = TopLevelKind::kNone;
  std::string reason;  ///< why this kind and resolution, as a sentence
  std::uint32_t cells[3] = {0, 0, 0};
  Bounds3d bounds;
  std::size_t instance_count = 0;  ///< with a box, so reachable
  std::size_t cell_count = 0;
  std::size_t occupied_cells = 0;
  std::size_t reference_count = 0;  ///< instances counted once per cell that lists them
  std::size_t max_references_in_cell = 0;
  std::size_t memory_bytes = 0;
  double build_ms = 0.0;
};

/// An immutable top level over the world boxes of instances; copies share all memory.
class TopLevel {
 public:
  TopLevel() = default;
  /// boxes[i] is the box of instance i.
  [[nodiscard]] static TopLevel build(std::span<const InstanceBox> boxes);
  /// The same with some boxes replaced, in order.
  [[nodiscard]] TopLevel updated(std::span<const BoxChange> changes) const;

  /// Calls `visit(instance_id)` once for every instance that can hold a hit in [ray.tnear, far], roughly
  /// from near to far. `visit` returns the largest t still of interest (the best t so far; -infinity ends
  /// the walk), which narrows `far`.
  template <class Visit>
  void traverse(const Ray& ray, double far, Visit&& visit) const;

  [[nodiscard]] const Bounds3d& bounds() const { return bounds_; }  ///< holds every box
  [[nodiscard]] std::size_t slots() const { return boxes_.size(); }
  [[nodiscard]] const InstanceBox& box(std::uint32_t instance_id) const { return boxes_[instance_id]; }
  [[nodiscard]] TopLevelStats stats() const;
  [[nodiscard]] Status validate() const;

 private:
  ChunkedVector<InstanceBox> boxes_;
  std::vector<std::uint32_t> always_;  ///< ids tested for every ray, ascending
  Bounds3d bounds_;
};

template <class Visit>
void TopLevel::traverse(const Ray& ray, double far, Visit&& visit) const {
  if (bounds_.empty()) return;
  const WorldRay world(ray, bounds_);
  for (const std::uint32_t id : always_) {
    const InstanceBox& box = boxes_[id];
    if (!intersect_box(world, box.bounds, box.drift * world.distance + world.slack, far).empty())
      far = visit(id);
  }
}

}  // namespace gridcast::tlas
