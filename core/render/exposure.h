#pragma once

#include "core/render/lighting.h"
#include "core/render/render.h"

namespace gridcast::render {

/// The lights of a picture. A scene with lights of its own is exposed like a camera would: a small pilot
/// picture of direct light is taken, and the exposure puts its brighter middle (the 75th percentile of what
/// is lit) at 0.5. A third of the default sky, scaled to that exposure, fills the shadows. A scene without
/// lights, or one whose lights reach nothing in the picture, gets the default ones at exposure 1.
[[nodiscard]] Lighting light_scene(const scene::Scene& scene, const RenderSettings& settings);

}  // namespace gridcast::render
