#include "core/math/exact.h"

namespace gridcast {
namespace {

// 6 products of three factors, two of them two-term sums: 2 * 2 * 2 * 2 terms each.
using SideExpansion = Expansion<96>;
// The same with three two-term sums.
using OrientationExpansion = Expansion<192>;

template <std::size_t kCapacity>
void add_product(Expansion<kCapacity>& sum, double a, double b, double c) {
  if (a == 0.0 || b == 0.0 || c == 0.0) return;
  const TwoTerm bc = two_product(b, c);
  const TwoTerm low = two_product(a, bc.low);
  const TwoTerm high = two_product(a, bc.high);
  sum.add(low.low);
  sum.add(low.high);
  sum.add(high.low);
  sum.add(high.high);
}

template <std::size_t kCapacity>
void add_product(Expansion<kCapacity>& sum, double a, const TwoTerm& b, const TwoTerm& c) {
  add_product(sum, a, b.low, c.low);
  add_product(sum, a, b.low, c.high);
  add_product(sum, a, b.high, c.low);
  add_product(sum, a, b.high, c.high);
}

bool parallel(const Vec3d& d, const TwoTerm (&a)[3]) {
  return difference_of_products(d.x, a[1].high, d.y, a[0].high) == 0.0 &&
         difference_of_products(d.y, a[2].high, d.z, a[1].high) == 0.0 &&
         difference_of_products(d.z, a[0].high, d.x, a[2].high) == 0.0;
}

/// Whether d . (a x b) is 0 for one of the reasons that are common and cheap to see, where a and b have no
/// low parts: the ray passes through a corner, or it runs along an axis and meets the side there.
bool plainly_zero(const Vec3d& d, const TwoTerm (&a)[3], const TwoTerm (&b)[3]) {
  for (int axis = 0; axis < 3; ++axis)
    if (a[axis].low != 0.0 || b[axis].low != 0.0) return false;
  for (int axis = 0; axis < 3; ++axis) {
    const int next = (axis + 1) % 3;
    const int last = (axis + 2) % 3;
    if (d[next] == 0.0 && d[last] == 0.0)
      return difference_of_products(a[next].high, b[last].high, a[last].high, b[next].high) == 0.0;
  }
  return parallel(d, a) || parallel(d, b);
}

}  // namespace

double exact_side(const Vec3d& d, const Vec3d& o, const Vec3d& p, const Vec3d& q) {
  TwoTerm a[3];
  TwoTerm b[3];
  for (int axis = 0; axis < 3; ++axis) {
    a[axis] = two_difference(p[axis], o[axis]);
    b[axis] = two_difference(q[axis], o[axis]);
  }
  if (plainly_zero(d, a, b)) return 0.0;
  SideExpansion sum;
  for (int axis = 0; axis < 3; ++axis) {
    const int next = (axis + 1) % 3;
    const int last = (axis + 2) % 3;
    add_product(sum, d[axis], a[next], b[last]);
    add_product(sum, -d[axis], a[last], b[next]);
  }
  return sum.value();
}

double exact_orientation(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& o) {
  TwoTerm from_o[3][3];
  const Vec3d* corners[3] = {&a, &b, &c};
  for (int corner = 0; corner < 3; ++corner)
    for (int axis = 0; axis < 3; ++axis)
      from_o[corner][axis] = two_difference((*corners[corner])[axis], o[axis]);
  OrientationExpansion sum;
  for (int axis = 0; axis < 3; ++axis) {
    const int next = (axis + 1) % 3;
    const int last = (axis + 2) % 3;
    for (const double x : {from_o[0][axis].low, from_o[0][axis].high}) {
      add_product(sum, x, from_o[1][next], from_o[2][last]);
      add_product(sum, -x, from_o[1][last], from_o[2][next]);
    }
  }
  return sum.value();
}

}  // namespace gridcast
