#pragma once
// Rays that come line by line, as the pixels of a camera do.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/math/ray_batch.h"

namespace gridcast::scene {

/// Lines of `width` rays, the first of which lacks its first `missing` ones; the last may be cut short too.
struct Raster {
  std::size_t width;
  std::size_t missing;
};

/// The raster of a batch whose rays are neighbours along a line, and about as near across the lines. Nothing
/// where the first lines do not show one. `diagonal` is the scene's, > 0. Looks at two lines and a few places
/// more.
[[nodiscard]] std::optional<Raster> find_raster(const RayBatch& rays, double diagonal);

/// The rays of a raster by squares of four by four, line by line of squares: sixteen that follow each other
/// are half as far apart as sixteen of one line.
[[nodiscard]] std::vector<std::uint32_t> order_by_tiles(const Raster& raster, std::size_t count);

}  // namespace gridcast::scene
