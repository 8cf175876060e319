#pragma once

#include <cstdint>

namespace gridcast::measure {

/// How many of how many. Having seen none among N says no more than that the true rate is below 3 / N, with a
/// confidence of 95 % ("If nothing goes wrong, is everything all right?", J. Hanley, 1983).
struct Rate {
  std::uint64_t count = 0;
  std::uint64_t of = 0;  ///< 0: there was nothing to count among

  [[nodiscard]] bool known() const { return of > 0; }
  [[nodiscard]] double share() const { return known() ? double(count) / double(of) : 0.0; }
  [[nodiscard]] double per_million() const { return 1e6 * share(); }
  /// What the rate is below when count is 0.
  [[nodiscard]] double below_per_million() const { return known() ? 3e6 / double(of) : 1e6; }
};

}  // namespace gridcast::measure
