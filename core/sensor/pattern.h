#pragma once
// Sensors as patterns of rays: the ray of a number is a function of the pattern alone.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <variant>
#include <vector>

#include "core/error.h"
#include "core/math/affine.h"
#include "core/math/ray.h"

namespace gridcast::sensor {

/// A camera with square pixels: the ray through every pixel's centre, rows from top to bottom.
struct Pinhole {
  std::uint32_t width_px = 0, height_px = 0;
  double yfov_rad = 0.8;  ///< full vertical angle, in (0, pi)
};
/// A camera without perspective and with square pixels: parallel rays along -z.
struct Orthographic {
  std::uint32_t width_px = 0, height_px = 0;
  double height_m = 1.0;  ///< what the picture shows from its top to its bottom edge
};
/// Equidistant projection: the angle from the axis grows in proportion with the distance from the centre of
/// the picture, and is half of `fov_rad` at the image circle, which touches the nearer edges. Pixels whose
/// centre lies outside of the circle have an invalid ray.
struct Fisheye {
  std::uint32_t width_px = 0, height_px = 0;
  double fov_rad = 3.14159265358979323846;  ///< full angle across the circle, in (0, 2 pi]
};
/// A turning scanner: one ring of rays per elevation, `azimuth_count` steps from `azimuth_from_rad`. Azimuth
/// 0 is -z and grows counter-clockwise as seen from +y, elevation grows towards +y.
struct Lidar {
  std::vector<double> elevations_rad;  ///< each in [-pi/2, pi/2]
  double azimuth_from_rad = 0.0;
  double azimuth_step_rad = 0.0;
  std::uint32_t azimuth_count = 0;
};
/// Parallel rays along -z from the nodes of a grid in the sensor's xy plane, centred on it, rows from top
/// (+y) to bottom.
struct Grid {
  std::uint32_t columns = 0, rows = 0;
  double x_spacing_m = 1.0, y_spacing_m = 1.0;
};

struct Sensor {
  Affine world_from_sensor;  ///< rigid; the sensor looks along its -z, +y up
  std::variant<Pinhole, Orthographic, Fisheye, Lidar, Grid> model;
  double max_range = std::numeric_limits<double>::infinity();  ///< metres
};

/// What is wrong with a sensor, if anything: `where` names the member (`/pose`, `/yfov_deg` ...), angles as
/// they come in degrees.
[[nodiscard]] Status check(const Sensor& sensor);

/// Rows times columns; 0 when that is more than 2^32.
[[nodiscard]] std::size_t ray_count(const Sensor& sensor);

/// The ray of number `i`, which is below ray_count(): row by row, a lidar ring by ring. [0, max_range], its
/// direction of length 1 but for rounding, so that t is in metres. The direction is zero, hence the ray
/// invalid, where a fisheye sees nothing. `sensor` is one that check() takes.
[[nodiscard]] Ray ray(const Sensor& sensor, std::size_t i);

}  // namespace gridcast::sensor
