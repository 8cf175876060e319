#pragma once
// The deformation set: what vertices may do from frame to frame, from what a refit is meant for to what makes
// nonsense of any tree that was built before.

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/math/vec.h"

namespace gridcast::measure {

/// Named by what the vertices do from phase 0 to 1. "Size" is the largest extent of the rest position's box,
/// "centre" its middle.
enum class Deformation : std::uint8_t {
  kWobble,         ///< waves of a tenth of the size run through the mesh
  kTwist,          ///< four turns about the y axis, from bottom to top
  kFold,           ///< the half beyond the centre turns about it by 180 degrees
  kExplode,        ///< every vertex flies its own way, from 0.01 to 10,000 sizes
  kCollapsePlane,  ///< y shrinks to that of the centre
  kCollapseLine,   ///< y and z do
  kCollapsePoint,  ///< all shrinks to a millionth
  kShuffle,        ///< in every frame the vertices take each other's places anew
  kReturn          ///< from a shuffled mesh half of the way back, then at once at rest, where it stays
};
inline constexpr std::array kAllDeformations{
    Deformation::kWobble,        Deformation::kTwist,         Deformation::kFold,
    Deformation::kExplode,       Deformation::kCollapsePlane, Deformation::kCollapseLine,
    Deformation::kCollapsePoint, Deformation::kShuffle,       Deformation::kReturn};
/// wobble, twist, fold, explode, collapse_plane, collapse_line, collapse_point, shuffle, return.
[[nodiscard]] std::string_view to_string(Deformation deformation);

/// The vertices `rest` at `phase` in [0, 1], object space. Phase 0 is `rest`, bit for bit, and so is
/// kReturn's second half, whose phase 0 is shuffled. Finite as long as 20,000 sizes are. Depends on nothing
/// but the arguments; `seed` is that of kExplode, kShuffle and kReturn.
[[nodiscard]] std::vector<Vec3f> deformed(Deformation deformation, std::span<const Vec3f> rest, double phase,
                                          std::uint64_t seed);

}  // namespace gridcast::measure
