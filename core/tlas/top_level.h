#pragma once
// The top level: leads a world ray to the instances it can touch.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/math/bounds.h"
#include "core/math/ray.h"

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

/// Placeholder until the grid is here.
class TopLevel {
 public:
  [[nodiscard]] TopLevelStats stats() const { return {}; }
};

}  // namespace gridcast::tlas
