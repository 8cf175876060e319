#pragma once
// The body of POST .../renders.

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/math/instance_mask.h"
#include "core/math/ray.h"
#include "proto/limits.h"
#include "proto/parsed.h"

namespace gridcast::proto {

/// "auto": a camera that sees the whole scene.
struct AutoCamera {};
/// An integer: the camera of that index in the scene's file.
struct FileCamera {
  std::uint32_t index = 0;
};
/// {"eye": [x,y,z], "target": [x,y,z], "up": [x,y,z]?, "yfov_deg": 45?}, world space, metres.
struct LookAtCamera {
  Vec3d eye{0.0};
  Vec3d target{0.0};
  Vec3d up{0.0, 1.0, 0.0};
  double yfov_deg = 45.0;  ///< full vertical angle, inside (0, 180)
};
using CameraChoice = std::variant<AutoCamera, FileCamera, LookAtCamera>;

enum class ImageFormat : std::uint8_t { kPng, kExr };
[[nodiscard]] std::string_view media_type(ImageFormat format);  ///< image/png, image/x-exr

struct RenderRequest {
  CameraChoice camera;
  int width_px = 640;
  int height_px = 480;
  std::string integrator = "whitted";  ///< one of kIntegratorNames
  std::vector<std::string> layers;     ///< each of kLayerNames, each once; EXR only
  int samples = 1;
  int max_depth = 4;
  Precision precision = Precision::kRobust;
  ImageFormat format = ImageFormat::kPng;
  std::optional<double> deadline_ms;
  InstanceMask mask = kFullMask;  ///< which instances are in the picture
};

/// JSON with members as above, all optional, plus "format": "png"|"exr". Without `format` the Accept header
/// chooses (PNG first). Problems: not_acceptable when Accept takes neither, or not the `format` asked for;
/// out_of_range for sizes, for width x height x samples over the budget, and for layers in a PNG.
[[nodiscard]] Parsed<RenderRequest> parse_render_request(std::string_view body, std::string_view accept,
                                                         const Limits& limits);

}  // namespace gridcast::proto
