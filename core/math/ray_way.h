#pragma once
// One ray's way through both levels, told step by step: what `scene::explain` fills and what is written of
// it.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "core/math/vec.h"

namespace gridcast {

// Every t is that of the world ray. t_enter and t_exit are those of the tests that the kernels make, in
// floats and with room for their rounding, so a box may be entered a little before it begins; t_enter is at
// least tnear.

/// How the instances of a cell are kept: none, boxes in a row, or a tree of boxes.
enum class CellContent : std::uint8_t { kEmpty, kList, kTree };

/// A cell of the grid that the ray passes; what it lists comes next.
struct CellStep {
  std::array<std::uint32_t, 3> cell{};
  double t_enter = 0.0, t_exit = 0.0;
  CellContent content = CellContent::kEmpty;
  std::uint32_t instances = 0;       ///< listed
  std::uint32_t skipped_blocks = 0;  ///< empty blocks of cells left at once since the cell before
};

/// A block of cells whose instances are looked at one by one, for a ray from so far away that cells are too
/// narrow for its rounding.
struct BlockStep {
  std::array<std::uint32_t, 3> block{};
  double t_enter = 0.0, t_exit = 0.0;
  std::uint32_t instances = 0;       ///< that reach into it
  std::uint32_t skipped_blocks = 0;  ///< empty ones that the ray may pass since the block before
};

/// A node of the tree of a crowded cell, or a leaf of up to eight instances, which come next.
struct CellNodeStep {
  std::uint32_t depth = 0;
  double t_enter = 0.0;
  std::uint32_t children = 0;
  std::uint32_t children_hit = 0;  ///< those that the cell before has shown to the ray not counted
  std::uint32_t stack = 0;         ///< entries that wait, children of this one included
};

/// kEntered: its tree is next. kMeshMissed: the world box is hit, the mesh's own box is not. kBoxMissed: the
/// world box is missed. kBeyondBest: its box begins behind the best hit so far. kAlreadyTested: the cell
/// before lists it too. kOtherBlock: is tested in another block that it reaches into. kMasked: the query's
/// mask does not see it.
enum class InstanceOutcome : std::uint8_t {
  kEntered,
  kMeshMissed,
  kBoxMissed,
  kBeyondBest,
  kAlreadyTested,
  kOtherBlock,
  kMasked
};

struct InstanceStep {
  std::uint32_t instance_id = kInvalidId;
  std::uint32_t mesh_id = kInvalidId;
  InstanceOutcome outcome = InstanceOutcome::kBoxMissed;
  std::optional<double> t_enter;  ///< of its world box, where that was asked for and hit
  std::string_view structure;     ///< of an entered one: the kind of its tree
};

/// An inner node of a mesh's tree; a kd-tree's treelet of up to eight cells is one. The root of a wide BVH
/// has no box of its own and is entered where the ray begins.
struct NodeStep {
  std::uint32_t node = 0;  ///< index in the structure
  std::uint32_t depth = 0;
  double t_enter = 0.0;
  std::uint32_t children = 0;
  std::uint32_t children_hit = 0;
  std::uint32_t stack = 0;  ///< entries that wait, farther children of this one included
};

struct LeafStep {
  std::uint32_t leaf = 0;  ///< index of the node (bvh) or of the first block of triangles in the structure
  std::uint32_t depth = 0;
  double t_enter = 0.0;
  std::uint32_t triangles = 0;
  std::uint32_t stack = 0;
};

/// kFiltered: ruled out by float arithmetic beside three others, not tested. kMissed: tested and not hit.
/// kHit: hit in the range. kOutOfRange: hit before tnear or behind tfar. kExcluded: hit, but the ray starts
/// on it.
enum class TriangleVerdict : std::uint8_t { kFiltered, kMissed, kHit, kOutOfRange, kExcluded };

struct TriangleStep {
  std::uint32_t primitive_id = kInvalidId;
  TriangleVerdict verdict = TriangleVerdict::kMissed;
  bool is_best = false;     ///< a hit that became the best so far
  std::optional<double> t;  ///< where the plane is hit; of `exact` within its bound, not yet corrected
};

/// A structure whose inside cannot be seen.
struct OpaqueStep {
  std::string_view structure;
  bool found_best = false;  ///< whether it replaced the best hit so far
};

using WayStep = std::variant<CellStep, BlockStep, CellNodeStep, InstanceStep, NodeStep, LeafStep,
                             TriangleStep, OpaqueStep>;

/// How many steps of each kind there are.
struct WayCounts {
  std::uint64_t cells = 0, blocks = 0, skipped_blocks = 0, cell_nodes = 0;
  std::uint64_t instances = 0;         ///< entered
  std::uint64_t passed_instances = 0;  ///< all others
  std::uint64_t nodes = 0, leaves = 0;
  std::uint64_t triangles = 0;           ///< tested
  std::uint64_t filtered_triangles = 0;  ///< not tested
  std::uint32_t max_stack = 0;           ///< of any tree
};

/// Collects the steps of a way up to a limit. Whoever walks stops when it says so.
class RayWay {
 public:
  /// At most `max_steps`, for a ray that ends at `tfar`.
  RayWay(std::size_t max_steps, double tfar, std::stop_token stop)
      : max_steps_(max_steps), tfar_(tfar), stop_(std::move(stop)) {}

  /// Keeps a step. False when it has no room for it, or the work was stopped: the walk ends.
  bool add(const WayStep& step);
  /// What add() said last, for work that makes no step; looks at the stop token.
  [[nodiscard]] bool goes_on();

  [[nodiscard]] bool is_truncated() const { return is_truncated_; }
  [[nodiscard]] bool is_stopped() const { return is_stopped_; }
  [[nodiscard]] double tfar() const { return tfar_; }
  [[nodiscard]] const WayCounts& counts() const { return counts_; }
  [[nodiscard]] const std::vector<WayStep>& steps() const { return steps_; }
  [[nodiscard]] std::vector<WayStep> take_steps() && { return std::move(steps_); }

 private:
  void count(const CellStep& step);
  void count(const BlockStep& step);
  void count(const CellNodeStep& step);
  void count(const InstanceStep& step);
  void count(const NodeStep& step);
  void count(const LeafStep& step);
  void count(const TriangleStep& step);
  void count(const OpaqueStep& step);

  std::size_t max_steps_;
  double tfar_;
  std::stop_token stop_;
  std::vector<WayStep> steps_;
  WayCounts counts_;
  bool is_truncated_ = false;
  bool is_stopped_ = false;
};

}  // namespace gridcast
