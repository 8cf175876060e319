#pragma once
// Whether a refitted tree is still good, and what is to be done when it is not.

#include <optional>
#include <string>

#include "core/blas/blas.h"

namespace gridcast::scene {

/// Who builds anew what has become worse. kInBackground: somebody takes orders for better trees
/// (tree_replacement.h), and a tree that is no longer good serves until theirs comes in.
enum class RebuildPlace : std::uint8_t { kInUpdate, kInBackground };

/// A refitted tree goes when it has become this many times worse than a good one was; after the rule of
/// C. Lauterbach, 2006. Rays take up to twice what the measure says (tests/bench has figures), so that the
/// worst of all frames stays below three times a new tree.
inline constexpr double kMaxRefitCostRatio = 1.5;
/// Beyond this a better tree is ordered, where somebody builds in the background.
inline constexpr double kOrderCostRatio = 1.25;
/// Larger meshes are rebuilt in Morton order, or in the background: the query that follows an update waits
/// half as long, or not at all. Below, the better tree takes a few milliseconds.
inline constexpr std::size_t kFastRebuildTriangles = std::size_t(1) << 14;
/// How much more a tree in Morton order is held to cost than a good one of the same mesh. By it a Morton tree
/// is judged by the good tree's cost, not by its own: else a refit of it would be allowed both factors.
inline constexpr double kMortonCostRatio = 1.2;

/// Where a random ray meets more boxes of triangles than this, leaves share triangles: boxes overlap whatever
/// the tree, and one that cuts triangles at planes costs four fifths of one that does not, two thirds of a
/// Morton tree (tests/bench has figures). A mesh at rest is met in tens, one whose vertices are thrown about
/// in thousands.
inline constexpr double kCrowdedBoxes = 4096.0;
/// Larger meshes get such a tree from the background alone: it takes four to seven times as long as one
/// in Morton order, 2 to 3 us of processor time a triangle.
inline constexpr std::size_t kSharedRebuildTriangles = std::size_t(1) << 20;

/// How a tree is built anew.
struct TreeForm {
  blas::BuildQuality quality = blas::BuildQuality::kDefault;
  blas::SpatialSplits spatial = blas::SpatialSplits::kNever;
  friend bool operator==(const TreeForm&, const TreeForm&) = default;
};

/// The best form for a mesh that moves, of which a random ray meets so many boxes of triangles: what a build
/// in the background makes, or one that was asked for. What moved will move again, and a tree without shared
/// triangles stays good longer, so leaves share them only where that gains most.
[[nodiscard]] TreeForm best_form(double boxes_per_ray, blas::BuildQuality asked);
/// The form that an update has time for.
[[nodiscard]] TreeForm quick_form(double boxes_per_ray, std::size_t triangles, blas::BuildQuality asked);

/// How a tree was built, how good its scene was asked to be, and who can build a better one.
struct TreeTerms {
  blas::BuildQuality built = blas::BuildQuality::kDefault;
  blas::BuildQuality asked = blas::BuildQuality::kDefault;  ///< a rebuild is never better than that
  RebuildPlace place = RebuildPlace::kInUpdate;
};

struct TreeVerdict {
  std::optional<TreeForm> rebuild_as;  ///< none: keep the refitted tree
  std::string reason;                  ///< a sentence
};

/// How many times worse a tree is than when it was built: the larger of two ratios. The cost of a ray through
/// the root box finds trees whose boxes fill the mesh; looseness, which measures boxes by those of the
/// triangles, finds trees built for large triangles that have shrunk since: a shuffled mesh that is put in
/// order again costs no more than at build, but hundreds of times what a new tree would.
[[nodiscard]] double worsening(const blas::StructureStats& refitted);

/// What triangle_boxes_per_ray told of the mesh of a wide or compact BVH when it was measured; 0 of other
/// kinds, whose leaves share nothing, and where it is not known.
[[nodiscard]] double boxes_per_ray(const blas::StructureStats& stats);

[[nodiscard]] TreeVerdict judge_refit(const blas::StructureStats& refitted, const TreeTerms& terms);

/// Whether a build in the background would give `tree` a better successor: it is in Morton order though more
/// was asked for, or has become worse. Small meshes never need one: their updates rebuild them.
[[nodiscard]] bool wants_better_tree(const blas::Blas& tree, blas::BuildQuality asked);

/// Why the tree is what it is, as a sentence without its full stop, for `structure`.
[[nodiscard]] std::string reason_of(const blas::Blas& tree, blas::BuildQuality asked);

}  // namespace gridcast::scene
