#pragma once

#include "core/scene/scene_data.h"

namespace gridcast::render {

/// A metallic-roughness material at one angle of view, split into what the integrator adds up.
struct Brdf {
  Vec3f diffuse{0.F};   ///< albedo of the matt part
  Vec3f specular{0.F};  ///< F0: reflectance of the surface seen straight on
  Vec3f transmit{0.F};  ///< tint of what passes through; 0 for opaque materials
  float roughness = 1.F;

  /// Share of the light that is mirrored at this cosine; rough surfaces gain less at grazing angles.
  [[nodiscard]] Vec3f fresnel(float cosine) const;
  /// Reflected radiance per irradiance of a light from `light` (unit): matt part plus highlight, without
  /// the cosine.
  [[nodiscard]] Vec3f evaluate(const Vec3d& normal, const Vec3d& view, const Vec3d& light) const;
};

[[nodiscard]] Brdf make_brdf(const scene::Material& material);

}  // namespace gridcast::render
