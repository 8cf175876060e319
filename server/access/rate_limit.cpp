#include "server/access/rate_limit.h"

#include <algorithm>

namespace gridcast::server::access {

RateLimit::RateLimit(std::optional<double> per_s)
    : per_s_(per_s), capacity_(std::max(1.0, per_s.value_or(1.0))), level_(capacity_) {}

std::optional<double> RateLimit::refuse(double cost, Clock::time_point now) {
  if (!per_s_) return std::nullopt;
  const std::lock_guard lock(mutex_);
  if (now > filled_at_) {
    level_ = std::min(capacity_, level_ + *per_s_ * ms_between(filled_at_, now) / 1000.0);
    filled_at_ = now;
  }
  const double lacking = std::min(cost, capacity_) - level_;
  if (lacking > 0.0) return lacking / *per_s_;
  level_ -= cost;
  return std::nullopt;
}

}  // namespace gridcast::server::access
