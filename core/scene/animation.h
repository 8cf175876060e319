#pragma once

#include <cstddef>
#include <span>

#include "core/scene/scene_data.h"

namespace gridcast::scene {

/// Time of the last key, in seconds; animations begin at 0.
[[nodiscard]] double duration_s(const Animation& animation);

/// Numbers per key: 3 for translation and scale, 4 for rotation, one per morph target for weights.
[[nodiscard]] std::size_t component_count(const AnimationChannel& channel);

/// The value of a channel at a finite time, clamped to its first and last key (glTF 2.0, appendix C): step,
/// linear (rotations on the shorter arc at constant speed), or cubic spline with tangents scaled by the
/// interval. Rotations come out as unit quaternions. `out` has component_count(channel) places.
void sample(const AnimationChannel& channel, double time_s, std::span<double> out);

}  // namespace gridcast::scene
