#include "core/measure/pareto.h"

#include <algorithm>

namespace gridcast::measure {
namespace {

bool dominates(const TradeoffPoint& a, const TradeoffPoint& b) {
  return a.speed >= b.speed && a.errors <= b.errors && (a.speed > b.speed || a.errors < b.errors);
}

}  // namespace

std::vector<bool> pareto_front(std::span<const TradeoffPoint> points) {
  std::vector<bool> front(points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    front[i] = std::none_of(points.begin(), points.end(),
                            [&](const TradeoffPoint& other) { return dominates(other, points[i]); });
  return front;
}

}  // namespace gridcast::measure
