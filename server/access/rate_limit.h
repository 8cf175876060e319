#pragma once

#include <mutex>
#include <optional>

#include "server/http/http_types.h"

namespace gridcast::server::access {

/// A token bucket: `per_s` a second on average, one second's worth (at least 1) at once. What costs more than
/// the bucket holds passes when it is full, and leaves a debt: no request is too large for ever. Any thread
/// may call.
class RateLimit {
 public:
  /// Nothing limits nothing.
  explicit RateLimit(std::optional<double> per_s);

  /// Takes `cost`; else takes nothing and says how many seconds it is until it could be had.
  [[nodiscard]] std::optional<double> refuse(double cost, Clock::time_point now = Clock::now());

 private:
  const std::optional<double> per_s_;
  const double capacity_;
  std::mutex mutex_;
  double level_;
  Clock::time_point filled_at_ = {};
};

}  // namespace gridcast::server::access
