#pragma once
// Where the rays of `gridcast cast` come from and where its answers go.

#include <cstddef>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "core/math/ray_batch.h"
#include "core/scene/scene.h"
#include "proto/ray_request.h"

namespace gridcast::server {

struct RaySource {
  std::string binary_path;  ///< "-" = stdin
  std::string json_path;
  std::string camera_grid;  ///< "1024x768": the default camera's primary rays
  std::string scalar = "float32";
  std::size_t columns = 6;
};

/// Rays with whatever memory they lie in.
struct RaySet {
  std::string bytes;          ///< of a file
  std::vector<double> rows;   ///< [N, 6], of a camera
  proto::RayRequest request;  ///< views one of the two, or its own rows
  [[nodiscard]] RayBatch batch() const { return request.batch(); }
};

/// A file larger than this is refused rather than read.
inline constexpr std::size_t kMaxRayFileBytes = std::size_t(16) << 30;

[[nodiscard]] Result<std::unique_ptr<RaySet>> read_rays(const RaySource& source, const scene::Scene& scene,
                                                        const std::stop_token& stop);

}  // namespace gridcast::server
