#pragma once

#include <cstdint>
#include <vector>

#include "core/measure/report.h"

namespace gridcast::measure {

/// What the frames of one deformation, in their order and at least one, come to.
[[nodiscard]] DeformSummaryRow summary_of(const std::vector<DeformRow>& rows, std::uint64_t triangles);

/// `all`: the worst of the worst and of the steady states, and the median of the medians. At least one part.
[[nodiscard]] DeformSummaryRow worst_of(const std::vector<DeformSummaryRow>& parts);

}  // namespace gridcast::measure
