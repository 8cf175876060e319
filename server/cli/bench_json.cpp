#include "server/cli/bench_json.h"

#include <nlohmann/json.hpp>

#include "server/machine.h"

namespace gridcast::server {
namespace {

using Json = nlohmann::ordered_json;

Json row_of(const measure::RayRow& row) {
  return {{"scene", row.scene},
          {"set", row.set},
          {"engine", row.engine},
          {"structure", row.structure},
          {"precision", row.precision},
          {"entry", row.entry},
          {"threads", row.threads},
          {"mrays_per_s", row.mrays_per_s},
          {"spread", row.spread},
          {"vs_embree_default", row.vs_embree_default},
          {"vs_embree_robust", row.vs_embree_robust}};
}
Json row_of(const measure::CheckRow& row) {
  return {{"scene", row.scene},
          {"set", row.set},
          {"structure", row.structure},
          {"precision", row.precision},
          {"entry", row.entry},
          {"threads", row.threads},
          {"rays", row.rays},
          {"hits", row.hits},
          {"differs", row.differs},
          {"brute_force_rays", row.brute_force_rays},
          {"brute_force_differs", row.brute_force_differs},
          {"embree_differs", row.embree_differs}};
}
Json row_of(const measure::BuildRow& row) {
  return {{"scene", row.scene},
          {"engine", row.engine},
          {"structure", row.structure},
          {"threads", row.threads},
          {"triangles", row.triangles},
          {"ms", row.ms},
          {"mtriangles_per_s", row.mtriangles_per_s},
          {"spread", row.spread},
          {"bytes_per_triangle", row.bytes_per_triangle},
          {"mesh_bytes_per_triangle", row.mesh_bytes_per_triangle},
          {"vs_embree_medium", row.vs_embree_medium},
          {"vs_embree_low", row.vs_embree_low}};
}
Json row_of(const measure::RefitRow& row) {
  return {{"scene", row.scene},
          {"engine", row.engine},
          {"structure", row.structure},
          {"threads", row.threads},
          {"triangles", row.triangles},
          {"ms", row.ms},
          {"mtriangles_per_s", row.mtriangles_per_s},
          {"spread", row.spread},
          {"vs_embree_refit", row.vs_embree_refit}};
}
Json row_of(const measure::InstanceRow& row) {
  return {{"scene", row.scene},
          {"engine", row.engine},
          {"structure", row.structure},
          {"update", row.update},
          {"threads", row.threads},
          {"instances", row.instances},
          {"moved", row.moved},
          {"ms", row.ms},
          {"ns_per_moved", row.ns_per_moved},
          {"spread", row.spread},
          {"bytes_per_instance", row.bytes_per_instance},
          {"vs_embree", row.vs_embree}};
}
Json row_of(const measure::ServeRow& row) {
  return {{"scene", row.scene},
          {"set", row.set},
          {"clients", measure::to_string(row.clients)},
          {"threads", row.threads},
          {"rays", row.rays},
          {"mrays_per_s", row.mrays_per_s},
          {"spread", row.spread},
          {"vs_in_process", row.vs_in_process}};
}

Json row_of(const measure::DeformRow& row) {
  return {{"scene", row.scene},
          {"deformation", row.deformation},
          {"frame", row.frame},
          {"action", row.action},
          {"cost_ratio", row.cost_ratio},
          {"update_ms", row.update_ms},
          {"fresh_ns_per_ray", row.fresh_ns_per_ray},
          {"vs_fresh", row.vs_fresh},
          {"spread", row.spread},
          {"embree_update_ms", row.embree_update_ms},
          {"embree_build_ms", row.embree_build_ms},
          {"embree_refit_vs_fresh", row.embree_refit_vs_fresh}};
}
Json row_of(const measure::DeformSummaryRow& row) {
  return {{"scene", row.scene},
          {"deformation", row.deformation},
          {"triangles", row.triangles},
          {"frames", row.frames},
          {"rebuilds", row.rebuilds},
          {"median_update_ms", row.median_update_ms},
          {"worst_update_ms", row.worst_update_ms},
          {"worst_vs_fresh", row.worst_vs_fresh},
          {"worst_frame", row.worst_frame},
          {"steady_vs_fresh", row.steady_vs_fresh},
          {"embree_worst_vs_fresh", row.embree_worst_vs_fresh},
          {"embree_steady_vs_fresh", row.embree_steady_vs_fresh}};
}
Json row_of(const measure::CrowdRow& row) {
  return {{"scene", row.scene},
          {"threads", row.threads},
          {"clients", row.clients},
          {"figures", row.figures},
          {"figure_triangles", row.figure_triangles},
          {"instances", row.instances},
          {"clock", row.clock},
          {"pairs", row.pairs},
          {"phase_s", row.phase_s},
          {"still_mrays_per_s", row.still_mrays_per_s},
          {"moving_mrays_per_s", row.moving_mrays_per_s},
          {"vs_still", row.vs_still},
          {"spread", row.spread},
          {"updates_per_s", row.updates_per_s},
          {"update_p50_ms", row.update_p50_ms},
          {"update_p99_ms", row.update_p99_ms},
          {"update_cpu_ms", row.update_cpu_ms},
          {"rebuilds_per_update", row.rebuilds_per_update}};
}

Json row_of(const measure::JsonBatchRow& row) {
  return {{"scene", row.scene},
          {"set", row.set},
          {"threads", row.threads},
          {"rays", row.rays},
          {"mrays_per_s", row.mrays_per_s},
          {"mrays_per_core_s", row.mrays_per_core_s},
          {"spread", row.spread},
          {"parse_share", row.parse_share},
          {"wait_share", row.wait_share},
          {"trace_share", row.trace_share},
          {"encode_share", row.encode_share}};
}
Json row_of(const measure::LatencyRow& row) {
  return {{"scene", row.scene},
          {"what", row.what},
          {"beside", row.beside},
          {"threads", row.threads},
          {"requests", row.requests},
          {"failed", row.failed},
          {"p50_ms", row.p50_ms},
          {"p99_ms", row.p99_ms},
          {"vs_base_p50", row.vs_base_p50},
          {"vs_base_p99", row.vs_base_p99},
          {"spread", row.spread}};
}
Json row_of(const measure::LoadRow& row) {
  return {{"scene", row.scene},
          {"phase", row.phase},
          {"clients", measure::to_string(row.clients)},
          {"threads", row.threads},
          {"rays", row.rays},
          {"repeat", row.repeat},
          {"phase_s", row.phase_s},
          {"offered_per_s", row.offered_per_s},
          {"goodput_per_s", row.goodput_per_s},
          {"vs_peak", row.vs_peak},
          {"spread", row.spread},
          {"vs_peak_by_cpu", row.vs_peak_by_cpu},
          {"accepted_p50_ms", row.accepted_p50_ms},
          {"accepted_p99_ms", row.accepted_p99_ms},
          {"vs_steady_p99", row.vs_steady_p99},
          {"refused_per_s", row.refused_per_s},
          {"refused_p50_ms", row.refused_p50_ms},
          {"refused_p99_ms", row.refused_p99_ms},
          {"failed", row.failed},
          {"not_sent", row.not_sent},
          {"late_p99_ms", row.late_p99_ms},
          {"clients_share", row.clients_share},
          {"recovery_s", row.recovery_s}};
}
Json row_of(const measure::GoneRow& row) {
  return {{"scene", row.scene},      {"threads", row.threads},     {"rays", row.rays},
          {"trials", row.trials},    {"median_ms", row.median_ms}, {"p99_ms", row.p99_ms},
          {"worst_ms", row.worst_ms}};
}

template <class Row>
Json rows_of(const std::vector<Row>& rows) {
  Json array = Json::array();
  for (const Row& row : rows) array.push_back(row_of(row));
  return array;
}

}  // namespace

std::string bench_json(const measure::Report& report, const measure::BenchOptions& options,
                       double scene_size) {
  const Json json{
      {"machine", machine_json()},
      {"settings",
       {{"rays", options.rays}, {"repeat", options.repeat}, {"seed", options.seed}, {"size", scene_size}}},
      {"rays", rows_of(report.rays)},
      {"build", rows_of(report.build)},
      {"refit", rows_of(report.refit)},
      {"instances", rows_of(report.instances)},
      {"deform", rows_of(report.deform)},
      {"deform_summary", rows_of(report.deform_summary)},
      {"serve", rows_of(report.serve)},
      {"crowd", rows_of(report.crowd)},
      {"json_batches", rows_of(report.json_batches)},
      {"latency", rows_of(report.latency)},
      {"load", rows_of(report.load)},
      {"gone", rows_of(report.gone)},
      {"checks", rows_of(report.checks)}};
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace gridcast::server
