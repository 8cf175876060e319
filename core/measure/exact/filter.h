#pragma once
// What extended precision can say for certain about a box or a triangle; the rest goes to exact arithmetic.
//
// Every bound below counts in u = 2^-64, the unit roundoff of long double (x87; the value comes from the
// compiler, so a wider type only makes it smaller). Its range of exponents holds every product of four
// doubles, so nothing here underflows or overflows.

#include <array>
#include <limits>

#include "core/math/affine.h"
#include "core/math/ray.h"

namespace gridcast::measure::exact {

using Wide = long double;
using Wide3 = std::array<Wide, 3>;
static_assert(std::numeric_limits<Wide>::max_exponent >= 4 * std::numeric_limits<double>::max_exponent - 4,
              "long double must hold products of four doubles");

struct WideBox {
  Wide3 lower, upper;
};

/// The ray's line cut to what lies in the box, by t. Empty when enter > exit.
struct Interval {
  Wide enter, exit;
};

struct WideRay {
  explicit WideRay(const Ray& ray);

  /// Contains every t at which the ray's line is in `box`, which is relative to the ray's origin.
  [[nodiscard]] Interval inside(const WideBox& box) const;

  Wide3 origin, direction;
  Wide largest;  ///< component of the direction, absolute
};

enum class Verdict { kMiss, kHit, kUnsure };

/// About the closed triangle and the ray's whole line. For kHit t is in [low, high]; for kUnsure it is if
/// there is a hit at all.
struct FilterAnswer {
  Verdict verdict = Verdict::kMiss;
  Wide low = -std::numeric_limits<Wide>::infinity();
  Wide high = std::numeric_limits<Wide>::infinity();
};

/// An instance as a ray sees it: x = A p + (T - origin) for object-space points p.
class InstanceFrame {
 public:
  /// `extent`: largest absolute coordinate of any p that will be asked for.
  InstanceFrame(const Affine& world_from_object, double extent, const WideRay& ray);

  /// Contains x of every p in the box [lower, upper].
  [[nodiscard]] WideBox image(const Vec3d& lower, const Vec3d& upper) const;
  [[nodiscard]] FilterAnswer test(const WideRay& ray, const std::array<Vec3f, 3>& corners) const;

 private:
  [[nodiscard]] Wide3 point(const Vec3f& p) const;

  std::array<Wide3, 3> rows_;  ///< of A
  Wide3 offset_;
  Wide error_;  ///< no component of a computed x is off by more
};

}  // namespace gridcast::measure::exact
