#pragma once

#include <cstdint>

#include "core/math/vec.h"

namespace gridcast::render {

/// Where sample `index` of `count` lies in pixel (x_px, y_px), both coordinates in [0, 1). One sample lies in
/// the centre; more are stratified (Hammersley points, shifted by a hash of the pixel). A function of its
/// arguments alone, so pictures do not depend on threads.
[[nodiscard]] glm::dvec2 pixel_sample(std::uint32_t x_px, std::uint32_t y_px, std::uint32_t index,
                                      std::uint32_t count);

}  // namespace gridcast::render
