#pragma once

#include "core/math/hit.h"
#include "core/scene/scene.h"

namespace gridcast::scene {

/// A certified bound of the error of hit.t: |t - t*| <= t_error, where t* is the exact solution of the
/// problem that the stored numbers pose: the ray as given, against the plane of the reported triangle with
/// the world corners A p + T, in real arithmetic. Right for every way to compute t. +infinity where the ray
/// is so nearly parallel to the plane that 100 bits cannot tell the two apart. In units of t.
///
/// t - t* = n . (o + t d - q) / n . d for any normal n and point q of the plane: both sides of the fraction
/// are computed with bounds of their own error (Certified), so the result exceeds |t - t*| itself by some
/// 2^-95 of the lengths involved over the sine of the angle between ray and plane.
[[nodiscard]] double t_error(const Scene& scene, const Ray& ray, const SurfaceHit& hit);

}  // namespace gridcast::scene
