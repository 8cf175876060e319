#pragma once
// What must come back, found without the structures under test.

#include "core/scene/scene.h"
#include "tests/stability/scene_spec.h"
#include "tests/stability/subject.h"
#include "tests/support/exact_reference.h"

namespace gridcast::stability {

/// The closest hit on a box with sides along the axes, closed, by the planes of its faces. Exact where
/// (plane - origin) / direction and the points there are: small multiples of powers of two and direction
/// components of -1, 0 and 1. A side of zero area has no triangles with area and is not hit.
[[nodiscard]] Expectation box_truth(const Bounds3d& box, const Ray& ray);

/// Every triangle of every instance, one after the other with the robust triangle test: for the top level and
/// the trees, whose answers must be these to the bit.
[[nodiscard]] Expectation every_triangle(const scene::Scene& scene, const Ray& ray);

/// The problem that the numbers of a scene pose in the world, in real arithmetic: what exact mode answers.
class WorldTruth {
 public:
  explicit WorldTruth(const SceneSpec& spec) : exact_(scene_data(spec)) {}

  [[nodiscard]] const measure::exact::Reference& reference() const { return *exact_.operator->(); }
  [[nodiscard]] Expectation closest(const Ray& ray) const;
  /// A ray whose answer is known: in robust mode by every triangle of `scene`, in exact mode by closest().
  [[nodiscard]] Shot shot(const scene::Scene& scene, const Ray& ray) const {
    return {ray, {}, every_triangle(scene, ray), closest(ray)};
  }

 private:
  test::ExactScene exact_;
};

/// `hit` of the exact reference as what exact mode must report; none is a miss.
[[nodiscard]] Expectation exactly(const std::optional<measure::exact::Hit>& hit);

}  // namespace gridcast::stability
