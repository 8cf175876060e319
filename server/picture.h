#pragma once
// From a request for a picture to its bytes: shared by the renders route and `gridcast render`.

#include <cstddef>
#include <stop_token>
#include <vector>

#include "core/render/render.h"
#include "proto/render_request.h"

namespace gridcast::server {

/// Errors: a camera index that the file does not have (`/camera`), an impossible view (`/camera/...`).
[[nodiscard]] Result<scene::Camera> choose_camera(const scene::Scene& scene,
                                                  const proto::CameraChoice& choice, double aspect_ratio);

/// The engine's settings of a checked request.
[[nodiscard]] Result<render::RenderSettings> render_settings(const scene::Scene& scene,
                                                             const proto::RenderRequest& request);

/// PNG of the first layer (the integrator's own), or EXR of all. kCancelled when stopped on the way.
[[nodiscard]] Result<std::vector<std::byte>> encode_picture(const render::Film& film,
                                                            proto::ImageFormat format,
                                                            const std::stop_token& stop = {});

}  // namespace gridcast::server
