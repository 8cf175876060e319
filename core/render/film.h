#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "core/math/uninitialized_allocator.h"

namespace gridcast::render {

/// Samples of a whole picture: hundreds of megabytes, which resize() leaves to the threads that paint them.
template <class T>
using Samples = std::vector<T, UninitializedAllocator<T>>;

/// One layer of a picture: float or integer samples, row by row from the top, `channels` interleaved.
struct Layer {
  std::string name;                   ///< color, depth, normal, instance_id, mesh_id, primitive_id
  std::vector<std::string> channels;  ///< R G B A; Z; X Y Z; id
  Samples<float> values;              ///< [height, width, channels]; empty for id layers
  Samples<unsigned> ids;              ///< [height, width]; empty for float layers; kInvalidId = background
};

/// Largest side of a picture.
inline constexpr int kMaxSidePx = 16384;

/// A finished picture. Colour is linear, scene-referred and includes the background; alpha is the share of
/// the pixel that geometry covers. Depth is t in metres along the unit ray, +inf for background; normals are
/// unit in world space, 0 for background.
struct Film {
  int width_px = 0;
  int height_px = 0;
  float exposure = 1.F;  ///< colour times this suits a display: 1 is white
  std::vector<Layer> layers;

  [[nodiscard]] const Layer* find(const std::string& name) const {
    for (const Layer& layer : layers)
      if (layer.name == name) return &layer;
    return nullptr;
  }
};

}  // namespace gridcast::render
