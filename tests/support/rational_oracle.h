#pragma once
// The second opinion about what the true answers are: another library (GMP's rationals) and another formula
// (the plane's equation, then barycentric coordinates in the plane's best projection) than
// core/measure/exact. No boxes, no filter: every ray against every triangle.

#include <optional>
#include <vector>

#include <gmpxx.h>

#include "core/math/ray.h"
#include "core/measure/exact/reference.h"

namespace gridcast::test {

struct RationalHit {
  PrimitiveRef primitive;
  mpq_class t, u, v;
};

class RationalOracle {
 public:
  RationalOracle(std::vector<measure::exact::Mesh> meshes, std::vector<measure::exact::Instance> instances);

  /// Every hit, by (t, instance_id, primitive_id).
  [[nodiscard]] std::vector<RationalHit> all(const Ray& ray) const;

 private:
  std::vector<measure::exact::Mesh> meshes_;
  std::vector<measure::exact::Instance> instances_;
};

/// Exactly the number that the reference found.
[[nodiscard]] mpq_class to_rational(const measure::exact::Ratio& ratio);

}  // namespace gridcast::test
