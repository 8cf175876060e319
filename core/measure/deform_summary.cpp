#include "core/measure/deform_summary.h"

#include <algorithm>
#include <utility>

#include "core/measure/statistics.h"

namespace gridcast::measure {

DeformSummaryRow summary_of(const std::vector<DeformRow>& rows, std::uint64_t triangles) {
  DeformSummaryRow sum;
  sum.scene = rows[0].scene;
  sum.deformation = rows[0].deformation;
  sum.triangles = triangles;
  sum.frames = rows.size();
  Samples update_ms, steady, embree_steady;
  const std::size_t steady_from = rows.size() - std::max<std::size_t>(1, rows.size() / 3);
  for (const DeformRow& row : rows) {
    update_ms.push_back(row.update_ms);
    if (row.action == "rebuild") ++sum.rebuilds;
    if (row.vs_fresh > sum.worst_vs_fresh) sum.worst_frame = row.frame;
    sum.worst_vs_fresh = std::max(sum.worst_vs_fresh, row.vs_fresh);
    sum.worst_update_ms = std::max(sum.worst_update_ms, row.update_ms);
    sum.embree_worst_vs_fresh = std::max(sum.embree_worst_vs_fresh, row.embree_refit_vs_fresh);
    if (row.frame <= steady_from) continue;
    steady.push_back(row.vs_fresh);
    embree_steady.push_back(row.embree_refit_vs_fresh);
  }
  sum.median_update_ms = median(std::move(update_ms));
  sum.steady_vs_fresh = median(std::move(steady));
  sum.embree_steady_vs_fresh = median(std::move(embree_steady));
  return sum;
}

DeformSummaryRow worst_of(const std::vector<DeformSummaryRow>& parts) {
  DeformSummaryRow all;
  all.scene = parts[0].scene;
  all.deformation = "all";
  all.triangles = parts[0].triangles;
  Samples update_ms;
  for (const DeformSummaryRow& part : parts) {
    all.frames += part.frames;
    all.rebuilds += part.rebuilds;
    update_ms.push_back(part.median_update_ms);
    all.worst_update_ms = std::max(all.worst_update_ms, part.worst_update_ms);
    all.worst_vs_fresh = std::max(all.worst_vs_fresh, part.worst_vs_fresh);
    all.steady_vs_fresh = std::max(all.steady_vs_fresh, part.steady_vs_fresh);
    all.embree_worst_vs_fresh = std::max(all.embree_worst_vs_fresh, part.embree_worst_vs_fresh);
    all.embree_steady_vs_fresh = std::max(all.embree_steady_vs_fresh, part.embree_steady_vs_fresh);
  }
  all.median_update_ms = median(std::move(update_ms));
  return all;
}

}  // namespace gridcast::measure
