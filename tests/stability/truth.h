#pragma once
// What must come back, found without the structures under test.

#include "core/scene/scene.h"
#include "tests/stability/scene_spec.h"
#include "tests/stability/subject.h"

namespace gridcast::stability {

/// The closest hit on a box with sides along the axes, closed, by the planes of its faces. Exact where
/// (plane - origin) / direction and the points there are: small multiples of powers of two and direction
/// components of -1, 0 and 1. A side of zero area has no triangles with area and is not hit.
[[nodiscard]] Expectation box_truth(const Bounds3d& box, const Ray& ray);

/// Every triangle of every instance, one after the other with the robust triangle test: for the top level and
/// the trees, whose answers must be these to the bit.
[[nodiscard]] Expectation every_triangle(const scene::Scene& scene, const Ray& ray);

}  // namespace gridcast::stability
