#include "core/io/layer_check.h"

namespace gridcast::io {

Status check_layer(const render::Film& film, const render::Layer& layer) {
  if (film.width_px < 1 || film.height_px < 1 || film.width_px > render::kMaxSidePx ||
      film.height_px > render::kMaxSidePx) {
    return Error{ErrorCode::kInvalidArgument, "a picture must have 1 to 16384 pixels a side", ""};
  }
  const std::size_t pixels = std::size_t(film.width_px) * std::size_t(film.height_px);
  const bool is_id = !layer.ids.empty();
  const bool fits = is_id ? layer.ids.size() == pixels && layer.values.empty() && layer.channels.size() == 1
                          : layer.values.size() == pixels * layer.channels.size() && !layer.channels.empty();
  if (fits) return ok_status();
  return Error{ErrorCode::kInvalidArgument,
               "layer '" + layer.name + "' does not have one sample per pixel and channel", ""};
}

}  // namespace gridcast::io
