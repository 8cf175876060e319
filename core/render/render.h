#pragma once

#include <stop_token>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/render/film.h"
#include "core/scene/scene.h"

namespace gridcast::render {

/// kWhitted is the lecture's loop: primary ray, closest hit, shadow rays, shading, reflection and refraction
/// to max_depth, background. The others write one layer (kId: instance_id) and trace primary rays only.
enum class Integrator : std::uint8_t { kWhitted, kDepth, kNormal, kId };
[[nodiscard]] std::string_view to_string(Integrator integrator);  ///< whitted, depth, normal, id
[[nodiscard]] Result<Integrator> parse_integrator(std::string_view name);

/// Layers that a picture may hold; all but colour come from one ray through the pixel's centre.
enum class LayerKind : std::uint8_t { kColor, kDepth, kNormal, kInstanceId, kMeshId, kPrimitiveId };
[[nodiscard]] std::string_view to_string(LayerKind layer);
[[nodiscard]] Result<LayerKind> parse_layer(std::string_view name);

struct RenderSettings {
  scene::Camera camera;
  int width_px = 640;
  int height_px = 480;
  Integrator integrator = Integrator::kWhitted;
  std::vector<LayerKind> layers;  ///< beside the integrator's own; duplicates are ignored
  int samples = 1;                ///< per pixel, stratified; the same settings always give the same bits
  int max_depth = 4;              ///< reflections and refractions after the primary ray
  Precision precision = Precision::kRobust;
  InstanceMask mask = kFullMask;  ///< which instances are there: for shadows, mirrors and glass too
};

/// Sizes and counts in range (1 to 16384 pixels a side, 1 to 4096 samples, 0 to 64 bounces), a usable camera.
/// The error names the field (`/width_px`).
[[nodiscard]] Status validate(const RenderSettings& settings);

/// Renders tile by tile over all cores; the integrator's own layer comes first. The film takes 16 bytes a
/// pixel for colour, 12 for normals, 4 for each other layer; nothing else grows with the picture. A scene
/// without lights gets a sun, a sky and a weak head light; a scene with lights is exposed automatically
/// (exposure.h), and Film::exposure says how. The bits do not depend on the number of threads. Errors:
/// invalid settings, kCancelled.
[[nodiscard]] Result<Film> render(const scene::Scene& scene, const RenderSettings& settings,
                                  std::stop_token stop = {}, const scene::ProgressCallback& progress = {});

/// The first camera of the file that is usable and sees more than a single triangle, else one that frames the
/// scene. Whatever a picture's mask, so that pictures of several masks lie on each other.
[[nodiscard]] scene::Camera default_camera(const scene::Scene& scene, double aspect_ratio);
/// The same, framing `bounds`: those of all that a sequence of pictures is going to show.
[[nodiscard]] scene::Camera default_camera(const scene::Scene& scene, const Bounds3d& bounds,
                                           double aspect_ratio);

}  // namespace gridcast::render
