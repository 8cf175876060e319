#pragma once
// Whether a refitted tree is still good.

#include <optional>
#include <string>

#include "core/blas/blas.h"

namespace gridcast::scene {

/// A refitted tree goes when it has become this many times worse than it was when built; after the rule of
/// C. Lauterbach, 2006.
inline constexpr double kMaxRefitCostRatio = 1.5;
/// Larger meshes are rebuilt in Morton order: the query that follows an update waits half as long, and its
/// rays cost some 10 % more. Below, the better tree takes a few milliseconds.
inline constexpr std::size_t kFastRebuildTriangles = std::size_t(1) << 14;

struct TreeVerdict {
  std::optional<blas::BuildQuality> rebuild_as;  ///< none: keep the refitted tree
  std::string reason;                            ///< a sentence
};

/// How many times worse a tree is than when it was built: the larger of two ratios. The cost of a ray through
/// the root box finds trees whose boxes fill the mesh; looseness, which measures boxes by those of the
/// triangles, finds trees built for large triangles that have shrunk since: a shuffled mesh that is put in
/// order again costs no more than at build, but hundreds of times what a new tree would.
[[nodiscard]] double worsening(const blas::StructureStats& refitted);

/// `asked` is the quality that the scene was asked for: a rebuild is never better than that.
[[nodiscard]] TreeVerdict judge_refit(const blas::StructureStats& refitted, blas::BuildQuality asked);

}  // namespace gridcast::scene
