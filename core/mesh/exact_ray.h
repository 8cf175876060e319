#pragma once

#include "core/math/affine.h"
#include "core/math/ray.h"
#include "core/mesh/object_ray.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::mesh {

/// What `exact` mode knows of a ray in one instance beside its ObjectRay: the problem that the stored numbers
/// pose, and how far the rounded object-space ray may be from it (derivation: exact_ray.cpp).
///
/// A ray of the exact problem is o* + t d* in object space, with A o* + T = o and A d* = d in real
/// arithmetic.
struct ExactRay {
  const Ray* world;
  const Affine* world_from_object;
  const TriangleMesh* mesh;
  /// Whether the object-space ray is worth anything. If not (an instance squeezed by 1e14 and more), no
  /// triangle may be culled by it, and none is decided in double.
  bool is_close;
  bool is_image;        ///< the object-space ray is (o*, d*) to the last bit
  double corner_error;  ///< of a sheared corner: e of intersect_triangle_exact
  double t_error;       ///< of t, but for what the edge functions add

  /// Prepares `object` for the instance and points it here. False when the ray was seen to miss the mesh
  /// between tnear and `far`; then neither is of use. The arguments must outlive both. `bounds` is that of
  /// the mesh.
  bool prepare(ObjectRay& object, const Ray& ray, const InstanceTransform& transform,
               const TriangleMesh& triangles, const Bounds3f& bounds, double far);
};

}  // namespace gridcast::mesh
