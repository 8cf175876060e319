#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <new>
#include <span>
#include <string>
#include <utility>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>
#include <png.h>

#include "core/io/image.h"
#include "core/io/layer_check.h"
#include "core/math/vec.h"

namespace gridcast::io {
namespace {

using Rgb = std::array<std::uint8_t, 3>;

std::uint8_t to_byte(float unit) {
  // NaN counts as 0: the first comparison fails for it.
  return unit > 0.F ? std::uint8_t(std::lround(255.F * std::min(unit, 1.F))) : std::uint8_t(0);
}

/// IEC 61966-2-1: linear light to the sRGB code value, both in [0, 1].
float srgb_code(float linear) {
  return linear <= 0.0031308F ? 12.92F * linear : 1.055F * std::pow(linear, 1.F / 2.4F) - 0.055F;
}

/// Leaves what is below the knee as it is and bends the rest towards 1, so that highlights keep their
/// shape instead of becoming flat white.
float shoulder(float value) {
  constexpr float kKnee = 0.75F;
  if (!(value > kKnee)) return value;
  const float over = (value - kKnee) / (1.F - kKnee);
  return 1.F - (1.F - kKnee) / (1.F + over);
}

Rgb color_pixel(const float* sample, float exposure) {
  Rgb rgb;
  for (std::size_t c = 0; c < 3; ++c)
    rgb[c] = to_byte(srgb_code(shoulder(std::max(0.F, exposure * sample[c]))));
  return rgb;
}

Rgb normal_pixel(const float* sample) {
  return {to_byte(0.5F * sample[0] + 0.5F), to_byte(0.5F * sample[1] + 0.5F),
          to_byte(0.5F * sample[2] + 0.5F)};
}

struct DepthRange {
  float nearest = std::numeric_limits<float>::infinity();
  float farthest = -std::numeric_limits<float>::infinity();
};

DepthRange depth_range(std::span<const float> values) {
  DepthRange range;
  for (const float z : values) {
    if (!std::isfinite(z)) continue;
    range.nearest = std::min(range.nearest, z);
    range.farthest = std::max(range.farthest, z);
  }
  return range;
}

Rgb depth_pixel(float z, const DepthRange& range) {
  if (!std::isfinite(z)) return {0, 0, 0};
  // The farthest surface stays apart from the black background.
  constexpr float kDarkest = 0.1F;
  const float extent = range.farthest - range.nearest;
  const float far = extent > 0.F ? (z - range.nearest) / extent : 0.F;
  const std::uint8_t level = to_byte(1.F - (1.F - kDarkest) * far);
  return {level, level, level};
}

/// Neighbouring ids get unlike colours: the bits are mixed first. None is dark, which the background is.
Rgb id_pixel(std::uint32_t id) {
  if (id == kInvalidId) return {0, 0, 0};
  // "Prospecting for Hash Functions", C. Wellons, 2018: a 32-bit mixer of low bias.
  std::uint32_t x = id + 0x9E3779B9U;
  x = (x ^ (x >> 16U)) * 0x7FEB352DU;
  x = (x ^ (x >> 15U)) * 0x846CA68BU;
  x ^= x >> 16U;
  const auto level = [](std::uint32_t bits) { return std::uint8_t(64U + (bits & 0xFFU) * 191U / 255U); };
  return {level(x), level(x >> 8U), level(x >> 16U)};
}

using Rgb8 = render::Samples<std::uint8_t>;

/// Whole only where it was not stopped.
Rgb8 to_rgb8(const render::Film& film, const render::Layer& layer, const std::stop_token& stop) {
  const std::size_t pixels = std::size_t(film.width_px) * std::size_t(film.height_px);
  const std::size_t channels = layer.channels.size();
  const DepthRange range = channels == 1 && layer.ids.empty() ? depth_range(layer.values) : DepthRange{};
  const auto pixel = [&](std::size_t i) {
    if (!layer.ids.empty()) return id_pixel(layer.ids[i]);
    if (channels == 1) return depth_pixel(layer.values[i], range);
    const float* sample = &layer.values[i * channels];
    return layer.name == "normal" ? normal_pixel(sample) : color_pixel(sample, film.exposure);
  };
  Rgb8 bytes;
  bytes.resize(3 * pixels);
  constexpr std::size_t kPixelsAtOnce = 16'384;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, pixels, kPixelsAtOnce), [&](const auto& part) {
    if (stop.stop_requested()) return;
    for (std::size_t i = part.begin(); i != part.end(); ++i) {
      const Rgb rgb = pixel(i);
      std::copy(rgb.begin(), rgb.end(), bytes.begin() + std::ptrdiff_t(3 * i));
    }
  });
  return bytes;
}

/// What libpng writes to as a file, since its short way of writing takes memory or a file: packed bytes come
/// some kilobytes at a time, each of which may be refused.
class StoppableSink {
 public:
  explicit StoppableSink(const std::stop_token& stop)
      : stop_(stop), file_(::fopencookie(this, "w", {nullptr, write, nullptr, nullptr})) {
    if (file_ == nullptr) throw std::bad_alloc();
    std::setvbuf(file_, nullptr, _IONBF, 0);
  }
  ~StoppableSink() { std::fclose(file_); }
  StoppableSink(const StoppableSink&) = delete;
  StoppableSink& operator=(const StoppableSink&) = delete;

  [[nodiscard]] std::FILE* file() const { return file_; }
  [[nodiscard]] std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  /// 0 is an error to the library. Nothing is thrown through it.
  static ssize_t write(void* cookie, const char* from, std::size_t size) noexcept try {
    auto& self = *static_cast<StoppableSink*>(cookie);
    if (self.stop_.stop_requested()) return 0;
    const auto* bytes = reinterpret_cast<const std::byte*>(from);
    self.bytes_.insert(self.bytes_.end(), bytes, bytes + size);
    return ssize_t(size);
  } catch (const std::bad_alloc&) {
    return 0;
  }

  const std::stop_token& stop_;
  std::vector<std::byte> bytes_;
  std::FILE* file_;
};

}  // namespace

Result<std::vector<std::byte>> encode_png(const render::Film& film, const render::Layer& layer,
                                          const std::stop_token& stop) {
  if (Status status = check_layer(film, layer); !status) return status.error();
  if (layer.ids.empty() && layer.channels.size() == 2) {
    return Error{ErrorCode::kInvalidArgument, "a layer of two channels has no picture", ""};
  }
  const Rgb8 rgb = to_rgb8(film, layer, stop);

  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = png_uint_32(film.width_px);
  image.height = png_uint_32(film.height_px);
  image.format = PNG_FORMAT_RGB;
  StoppableSink sink(stop);
  const bool is_written = png_image_write_to_stdio(&image, sink.file(), 0, rgb.data(), 0, nullptr) != 0;
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the picture was cancelled", ""};
  if (!is_written) return Error{ErrorCode::kInternal, std::string("libpng: ") + image.message, ""};
  return sink.take();
}

}  // namespace gridcast::io
