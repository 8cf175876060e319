#pragma once

#include <span>
#include <vector>

namespace gridcast::measure {

/// What a method costs and what it is worth.
struct TradeoffPoint {
  double speed = 0.0;   ///< more is better
  double errors = 0.0;  ///< less is better
};

/// For every point whether it is on the Pareto front: no other is at least as good in both and better in one.
[[nodiscard]] std::vector<bool> pareto_front(std::span<const TradeoffPoint> points);

}  // namespace gridcast::measure
