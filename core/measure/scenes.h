#pragma once
// The scenes of the benchmark by name: S1 to S6 are single meshes, I1 to I3 instances, W1 to W5 worst cases,
// H1 a hostile one for accuracy.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "core/error.h"
#include "core/scene/scene_data.h"

namespace gridcast::measure {

/// Where the primary rays come from.
struct View {
  Vec3d eye{0.0, 0.0, 4.0};
  Vec3d target{0.0};
  Vec3d up{0.0, 1.0, 0.0};
  double yfov_deg = 40.0;
  std::optional<Vec3d> light = std::nullopt;  ///< where shadow rays go; none: above the camera
};

struct BenchScene {
  std::string name;
  scene::SceneData data;
  View view;
};

struct SceneEntry {
  std::string_view name;
  std::string_view what;  ///< for people, with its full size
};
[[nodiscard]] std::span<const SceneEntry> scene_catalogue();

/// `size` in (0, 1] scales the number of triangles (S, W) or of instances (I). kNotFound for an unknown name.
[[nodiscard]] Result<BenchScene> make_scene(std::string_view name, std::uint64_t seed, double size = 1.0);

/// Any scene from a file, seen from a corner of its box.
[[nodiscard]] BenchScene framed_scene(std::string name, scene::SceneData data, const Bounds3d& bounds);

/// The first mesh of `data` alone, in its place and as it is.
[[nodiscard]] scene::SceneData first_mesh(const scene::SceneData& data);

/// Whether the scene is one mesh in its place, so that Embree needs no instances for it.
[[nodiscard]] bool is_single_mesh(const scene::SceneData& data);

}  // namespace gridcast::measure
