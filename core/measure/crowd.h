#pragma once
// A crowd of skinned figures among things that stand still: what deforms all the time while rays are cast.

#include <cstddef>
#include <cstdint>

#include "core/measure/scenes.h"

namespace gridcast::measure {

/// Seconds after which the animation of a crowd begins again.
inline constexpr double kCrowdLoopSeconds = 2.0;

struct CrowdSize {
  std::size_t figures = 30;  ///< of 2,000 to 5,000 triangles, each with a skin and a pose of its own
  std::size_t things = 300;  ///< rigid instances, about 1,500 triangles each
};

/// `share` in (0, 1] of the usual numbers, at least two figures and two things.
[[nodiscard]] CrowdSize crowd_size(double share);

/// On a square, y up, metres, 1.5 m apart; animation 0 moves every figure, each at its own moment of the same
/// walk. The same arguments give the same scene on every machine.
[[nodiscard]] BenchScene crowd_scene(const CrowdSize& size, std::uint64_t seed);

}  // namespace gridcast::measure
