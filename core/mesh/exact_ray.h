#pragma once

#include "core/math/affine.h"
#include "core/math/ray.h"
#include "core/mesh/object_ray.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::mesh {

/// The image of a world ray in the object space of an instance as doubles have it, and how far it may be from
/// the true one (derivation: exact_ray.cpp), o* + t d* with A o* + T = o and A d* = d in real arithmetic.
struct ExactImage {
  Vec3d origin, direction;
  double drift;   ///< as ObjectRay::prepare takes it; 0 where the image is not close
  bool is_close;  ///< whether the image is worth anything; not where an instance is squeezed by 1e14 and more
  bool is_image;  ///< the image is (o*, d*) to the last bit
};
/// `bounds` is that of the mesh.
[[nodiscard]] ExactImage exact_image(const Ray& ray, const InstanceTransform& transform,
                                     const Bounds3f& bounds);

/// What `exact` mode knows of a ray in one instance beside its ObjectRay: the problem that the stored numbers
/// pose, and bounds of what the triangle test may get wrong.
struct ExactRay {
  const Ray* world;
  const Affine* world_from_object;
  const TriangleMesh* mesh;
  bool is_close;  ///< of the image; if not, no triangle may be culled by it, and none is decided in double
  bool is_image;  ///< of the image
  double corner_error;  ///< of a sheared corner: e of intersect_triangle_exact
  double t_error;       ///< of t, but for what the edge functions add

  /// Prepares `object` for the instance and points it here. False when the ray was seen to miss the mesh
  /// between tnear and `far`; then neither is of use. The arguments must outlive both. `bounds` is that of
  /// the mesh.
  bool prepare(ObjectRay& object, const Ray& ray, const InstanceTransform& transform,
               const TriangleMesh& triangles, const Bounds3f& bounds, double far);
  /// The part of prepare() that follows the preparation of `object` for the image; sets all but the pointers
  /// here.
  void attach_to(ObjectRay& object, const ExactImage& image);
};

}  // namespace gridcast::mesh
