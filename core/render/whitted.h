#pragma once

#include "core/render/brdf.h"
#include "core/render/lighting.h"
#include "core/render/render.h"
#include "core/render/surface.h"
#include "core/scene/run_tracer.h"

namespace gridcast::render {

/// Shadow rays of many surfaces to one light: asked for first, traced together, then read in the same order.
struct ShadowQueue {
  std::vector<Ray> rays;
  std::vector<PrimitiveRef> from;
  std::vector<RayStatus> status;
  std::size_t next = 0;
};

/// Memory of Whitted::radiance over many rays, reused from call to call.
struct ShadeScratch {
  std::vector<Surface> surfaces;
  std::vector<ShadowQueue> queues;  ///< one a light
};

/// The lecture's loop: closest hit, shadow rays and shading, then reflection and refraction, or the
/// background. "An Improved Illumination Model for Shaded Display", T. Whitted, 1980; unlike the paper
/// surfaces are metallic-roughness ones, and what is too rough to mirror sees the sky instead of a ray.
class Whitted {
 public:
  /// Keeps references to the scene and the lighting: both outlive it. Of `settings` the precision and the
  /// mask of all rays count.
  Whitted(const scene::Scene& scene, const Lighting& lighting, const RenderSettings& settings, int max_depth);

  /// Radiance along a primary ray whose closest hit (or miss) is known.
  [[nodiscard]] Vec3f radiance(const Ray& ray, const SurfaceHit& hit) const;
  /// The same for many primary rays, bit for bit; their shadow rays are traced together, light by light.
  void radiance(std::span<const Ray> rays, std::span<const SurfaceHit> hits, scene::RunTracer& tracer,
                ShadeScratch& scratch, std::span<Vec3f> colors) const;

 private:
  struct Path {
    int depth = 0;       ///< reflections and refractions so far
    float weight = 1.F;  ///< what the radiance found will be multiplied with, at most
  };

  [[nodiscard]] Vec3f trace(const Ray& ray, PrimitiveRef from, Path path) const;
  [[nodiscard]] Vec3f shade(const Ray& ray, const SurfaceHit& hit, Path path) const;
  /// `answered` holds the shadows where they were traced before; null = trace them here.
  [[nodiscard]] Vec3f shade(const Surface& surface, Path path, std::vector<ShadowQueue>* answered) const;
  [[nodiscard]] Vec3f direct(const Surface& surface, const Brdf& brdf,
                             std::vector<ShadowQueue>* answered) const;
  void ask_for_shadows(const Surface& surface, std::vector<ShadowQueue>& queues) const;
  [[nodiscard]] Ray shadow_ray(const Surface& surface, const Illumination& light) const;
  [[nodiscard]] Vec3f reflected(const Surface& surface, const Brdf& brdf, const Vec3f& share,
                                Path path) const;
  [[nodiscard]] Vec3f refracted(const Surface& surface, const Vec3d& direction, const Vec3f& share,
                                Path path) const;
  [[nodiscard]] Vec3f visibility(const Surface& surface, const Illumination& light) const;
  [[nodiscard]] Vec3f through_glass(Ray ray, PrimitiveRef from) const;

  const scene::Scene& scene_;
  const Lighting& lighting_;
  Precision precision_;
  InstanceMask mask_;
  int max_depth_;
  bool has_glass_;
};

}  // namespace gridcast::render
