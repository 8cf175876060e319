#pragma once
// The body of POST .../sensors.

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/math/affine.h"
#include "proto/limits.h"
#include "proto/parsed.h"
#include "proto/query.h"
#include "proto/ray_options.h"

namespace gridcast::proto {

/// {"eye": [x,y,z], "target": [x,y,z], "up"?: [x,y,z]}
struct LookAtPose {
  Vec3d eye{0.0};
  Vec3d target{0.0};
  Vec3d up{0.0, 1.0, 0.0};
};
/// The latter is {"transform": rows}: world_from_sensor.
using SensorPose = std::variant<LookAtPose, Affine>;

/// Which rays, in the wire's units. A member that the type does not have keeps its default.
struct SensorRequest {
  std::string type;  ///< one of kSensorTypeNames
  SensorPose pose;
  std::uint32_t width_px = 0, height_px = 0;  ///< pinhole, fisheye, orthographic
  double yfov_deg = 45.0;                     ///< pinhole
  double fov_deg = 180.0;                     ///< fisheye
  double height = 1.0;                        ///< orthographic, metres
  std::vector<double> elevations_deg;         ///< lidar
  double azimuth_from_deg = 0.0;              ///< lidar
  double azimuth_step_deg = 1.0;              ///< lidar
  std::uint32_t azimuth_count = 0;            ///< lidar
  std::uint32_t columns = 0, rows = 0;        ///< grid
  double x_spacing = 1.0, y_spacing = 1.0;    ///< grid, metres

  double max_range = std::numeric_limits<double>::infinity();  ///< metres
  std::uint32_t max_returns = 1;
  double noise_sigma = 0.0;  ///< metres
  std::uint64_t noise_seed = 0;
  RayOptions options;
};

/// JSON {"type", "pose", ...}: see openapi.yaml. precision, fields, stats, deadline_ms and mask may come
/// in the query string, which wins. Problems: those of the readers; unknown_field for a member of another
/// type; invalid_value for the field t_error together with noise.
[[nodiscard]] Parsed<SensorRequest> parse_sensor_request(std::string_view body, const QueryParameters& query,
                                                         const Limits& limits);

}  // namespace gridcast::proto
