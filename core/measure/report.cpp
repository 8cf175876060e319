#include "core/measure/report.h"

namespace gridcast::measure {

std::uint64_t wrong_answers(const Report& report) {
  std::uint64_t wrong = 0;
  for (const CheckRow& row : report.checks) wrong += row.differs + row.brute_force_differs;
  return wrong;
}

}  // namespace gridcast::measure
