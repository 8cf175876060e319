#pragma once

#include "core/error.h"
#include "core/render/film.h"

namespace gridcast::io {

/// Sizes in range and samples of the right number, so that encoders may index without looking.
[[nodiscard]] Status check_layer(const render::Film& film, const render::Layer& layer);

}  // namespace gridcast::io
