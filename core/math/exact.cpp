#include "core/math/exact.h"

namespace gridcast {
namespace {

// 6 products of three factors, two of them two-term sums: 2 * 2 * 2 * 2 terms each.
using SideExpansion = Expansion<96>;

void add_product(SideExpansion& sum, double a, double b, double c) {
  if (a == 0.0 || b == 0.0 || c == 0.0) return;
  const TwoTerm bc = two_product(b, c);
  const TwoTerm low = two_product(a, bc.low);
  const TwoTerm high = two_product(a, bc.high);
  sum.add(low.low);
  sum.add(low.high);
  sum.add(high.low);
  sum.add(high.high);
}

void add_product(SideExpansion& sum, double a, const TwoTerm& b, const TwoTerm& c) {
  add_product(sum, a, b.low, c.low);
  add_product(sum, a, b.low, c.high);
  add_product(sum, a, b.high, c.low);
  add_product(sum, a, b.high, c.high);
}

}  // namespace

double exact_side(const Vec3d& d, const Vec3d& o, const Vec3d& p, const Vec3d& q) {
  TwoTerm a[3];
  TwoTerm b[3];
  for (int axis = 0; axis < 3; ++axis) {
    a[axis] = two_difference(p[axis], o[axis]);
    b[axis] = two_difference(q[axis], o[axis]);
  }
  SideExpansion sum;
  for (int axis = 0; axis < 3; ++axis) {
    const int next = (axis + 1) % 3;
    const int last = (axis + 2) % 3;
    add_product(sum, d[axis], a[next], b[last]);
    add_product(sum, -d[axis], a[last], b[next]);
  }
  return sum.value();
}

}  // namespace gridcast
