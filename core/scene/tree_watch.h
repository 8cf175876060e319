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

/// How a tree was built, how good its scene was asked to be, and who can build a better one.
struct TreeTerms {
  blas::BuildQuality built = blas::BuildQuality::kDefault;
  blas::BuildQuality asked = blas::BuildQuality::kDefault;  ///< a rebuild is never better than that
  RebuildPlace place = RebuildPlace::kInUpdate;
};

struct TreeVerdict {
  std::optional<blas::BuildQuality> rebuild_as;  ///< none: keep the refitted tree
  std::string reason;                            ///< a sentence
};

/// How many times worse a tree is than when it was built: the larger of two ratios. The cost of a ray through
/// the root box finds trees whose boxes fill the mesh; looseness, which measures boxes by those of the
/// triangles, finds trees built for large triangles that have shrunk since: a shuffled mesh that is put in
/// order again costs no more than at build, but hundreds of times what a new tree would.
[[nodiscard]] double worsening(const blas::StructureStats& refitted);

[[nodiscard]] TreeVerdict judge_refit(const blas::StructureStats& refitted, const TreeTerms& terms);

/// Whether a build in the background would give `tree` a better successor: it is in Morton order though more
/// was asked for, or has become worse. Small meshes never need one: their updates rebuild them.
[[nodiscard]] bool wants_better_tree(const blas::Blas& tree, blas::BuildQuality asked);

/// Why the tree is what it is, as a sentence without its full stop, for `structure`.
[[nodiscard]] std::string reason_of(const blas::Blas& tree, blas::BuildQuality asked);

}  // namespace gridcast::scene
