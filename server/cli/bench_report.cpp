#include "server/cli/bench_report.h"

#include <cstdio>

#include "server/cli/common.h"
#include "server/number_text.h"

namespace gridcast::server {
namespace {

/// "1.25", or a dash where there was nothing to compare with.
std::string ratio_text(double ratio) {
  if (!(ratio > 0.0)) return "-";
  char text[32];
  std::snprintf(text, sizeof(text), "%.2f", ratio);
  return text;
}

void print_rays(const measure::Report& report, std::size_t from) {
  if (report.rays.size() == from) return;
  std::printf("\n%-6s %-17s %-9s %-11s %-8s %-18s %4s %9s %7s %9s %8s\n", "scene", "rays", "engine",
              "structure", "precis.", "entry", "thr.", "Mrays/s", "spread", "x default", "x robust");
  for (std::size_t i = from; i < report.rays.size(); ++i) {
    const measure::RayRow& row = report.rays[i];
    std::printf("%-6s %-17s %-9s %-11s %-8s %-18s %4zu %9.3f %5.1f %% %9s %8s\n", row.scene.c_str(),
                row.set.c_str(), row.engine.c_str(), row.structure.c_str(), row.precision.c_str(),
                row.entry.c_str(), row.threads, row.mrays_per_s, 100.0 * row.spread,
                ratio_text(row.vs_embree_default).c_str(), ratio_text(row.vs_embree_robust).c_str());
  }
}

void print_checks(const measure::Report& report, std::size_t from) {
  for (std::size_t i = from; i < report.checks.size(); ++i) {
    const measure::CheckRow& row = report.checks[i];
    if (row.differs + row.brute_force_differs == 0) continue;
    std::printf("WRONG %s %s %s %s %s: %llu answers differ from single rays, %llu of %llu from brute force\n",
                row.scene.c_str(), row.set.c_str(), row.structure.c_str(), row.precision.c_str(),
                row.entry.c_str(), static_cast<unsigned long long>(row.differs),
                static_cast<unsigned long long>(row.brute_force_differs),
                static_cast<unsigned long long>(row.brute_force_rays));
  }
}

void print_builds(const measure::Report& report, std::size_t from) {
  if (report.build.size() == from) return;
  std::printf("\n%-6s %-9s %-16s %4s %11s %10s %9s %7s %9s %9s %8s %7s\n", "scene", "engine", "build", "thr.",
              "triangles", "ms", "Mtri/s", "spread", "bytes/tri", "mesh b/t", "x medium", "x low");
  for (std::size_t i = from; i < report.build.size(); ++i) {
    const measure::BuildRow& row = report.build[i];
    std::printf("%-6s %-9s %-16s %4zu %11s %10.2f %9.2f %5.1f %% %9.1f %9.1f %8s %7s\n", row.scene.c_str(),
                row.engine.c_str(), row.structure.c_str(), row.threads, grouped(row.triangles).c_str(),
                row.ms, row.mtriangles_per_s, 100.0 * row.spread, row.bytes_per_triangle,
                row.mesh_bytes_per_triangle, ratio_text(row.vs_embree_medium).c_str(),
                ratio_text(row.vs_embree_low).c_str());
  }
}

void print_refits(const measure::Report& report, std::size_t from) {
  if (report.refit.size() == from) return;
  std::printf("\n%-6s %-9s %-15s %4s %11s %10s %9s %7s %7s\n", "scene", "engine", "refit", "thr.",
              "triangles", "ms", "Mtri/s", "spread", "x refit");
  for (std::size_t i = from; i < report.refit.size(); ++i) {
    const measure::RefitRow& row = report.refit[i];
    std::printf("%-6s %-9s %-15s %4zu %11s %10.2f %9.2f %5.1f %% %7s\n", row.scene.c_str(),
                row.engine.c_str(), row.structure.c_str(), row.threads, grouped(row.triangles).c_str(),
                row.ms, row.mtriangles_per_s, 100.0 * row.spread, ratio_text(row.vs_embree_refit).c_str());
  }
}

void print_instances(const measure::Report& report, std::size_t from) {
  if (report.instances.size() == from) return;
  std::printf("\n%-6s %-9s %-15s %-18s %4s %10s %10s %9s %7s %10s %8s\n", "scene", "engine", "structure",
              "update", "thr.", "moved", "ms", "ns/moved", "spread", "bytes/inst", "x embree");
  for (std::size_t i = from; i < report.instances.size(); ++i) {
    const measure::InstanceRow& row = report.instances[i];
    std::printf("%-6s %-9s %-15s %-18s %4zu %10s %10.2f %9.0f %5.1f %% %10.1f %8s\n", row.scene.c_str(),
                row.engine.c_str(), row.structure.c_str(), row.update.c_str(), row.threads,
                grouped(row.moved).c_str(), row.ms, row.ns_per_moved, 100.0 * row.spread,
                row.bytes_per_instance, ratio_text(row.vs_embree).c_str());
  }
}

void print_serve(const measure::Report& report, std::size_t from) {
  if (report.serve.size() == from) return;
  std::printf("\n%-6s %-17s %-7s %4s %10s %9s %7s %13s\n", "scene", "over HTTP", "clients", "thr.", "rays",
              "Mrays/s", "spread", "x in process");
  for (std::size_t i = from; i < report.serve.size(); ++i) {
    const measure::ServeRow& row = report.serve[i];
    std::printf("%-6s %-17s %-7s %4zu %10s %9.3f %5.1f %% %13s\n", row.scene.c_str(), row.set.c_str(),
                measure::to_string(row.clients), row.threads, grouped(row.rays).c_str(), row.mrays_per_s,
                100.0 * row.spread, ratio_text(row.vs_in_process).c_str());
  }
}

void print_deformations(const measure::Report& report, std::size_t from) {
  if (report.deform_summary.size() == from) return;
  std::printf("\n%-6s %-15s %10s %7s %9s %10s %10s %8s %6s %8s %13s %13s\n", "scene", "deformation",
              "triangles", "frames", "rebuilds", "update ms", "worst ms", "/ fresh", "frame", "steady",
              "Embree refit", "steady");
  for (std::size_t i = from; i < report.deform_summary.size(); ++i) {
    const measure::DeformSummaryRow& row = report.deform_summary[i];
    std::printf("%-6s %-15s %10s %7zu %9zu %10.2f %10.2f %8s %6zu %8s %13s %13s\n", row.scene.c_str(),
                row.deformation.c_str(), grouped(row.triangles).c_str(), row.frames, row.rebuilds,
                row.median_update_ms, row.worst_update_ms, ratio_text(row.worst_vs_fresh).c_str(),
                row.worst_frame, ratio_text(row.steady_vs_fresh).c_str(),
                ratio_text(row.embree_worst_vs_fresh).c_str(),
                ratio_text(row.embree_steady_vs_fresh).c_str());
  }
}

void print_crowds(const measure::Report& report, std::size_t from) {
  if (report.crowd.size() == from) return;
  std::printf("\n%-6s %4s %-5s %7s %10s %9s %9s %8s %7s %10s %8s %8s %8s %9s\n", "scene", "thr.", "clock",
              "figures", "triangles", "still", "moving", "x still", "spread", "updates/s", "p50 ms", "p99 ms",
              "CPU ms", "rebuilds");
  for (std::size_t i = from; i < report.crowd.size(); ++i) {
    const measure::CrowdRow& row = report.crowd[i];
    std::printf("%-6s %4zu %-5s %7s %10s %9.3f %9.3f %8s %5.1f %% %10.1f %8.2f %8.2f %8.2f %9.2f\n",
                row.scene.c_str(), row.threads, row.clock.c_str(), grouped(row.figures).c_str(),
                grouped(row.figure_triangles).c_str(), row.still_mrays_per_s, row.moving_mrays_per_s,
                ratio_text(row.vs_still).c_str(), 100.0 * row.spread, row.updates_per_s, row.update_p50_ms,
                row.update_p99_ms, row.update_cpu_ms, row.rebuilds_per_update);
  }
}

void print_json_batches(const measure::Report& report, std::size_t from) {
  if (report.json_batches.size() == from) return;
  std::printf("\n%-6s %-17s %4s %10s %9s %11s %7s %7s %7s %7s %7s\n", "scene", "JSON", "thr.", "rays",
              "Mrays/s", "by CPU", "spread", "parse", "wait", "trace", "encode");
  for (std::size_t i = from; i < report.json_batches.size(); ++i) {
    const measure::JsonBatchRow& row = report.json_batches[i];
    std::printf("%-6s %-17s %4zu %10s %9.3f %11.3f %5.1f %% %5.1f %% %5.1f %% %5.1f %% %5.1f %%\n",
                row.scene.c_str(), row.set.c_str(), row.threads, grouped(row.rays).c_str(), row.mrays_per_s,
                row.mrays_per_core_s, 100.0 * row.spread, 100.0 * row.parse_share, 100.0 * row.wait_share,
                100.0 * row.trace_share, 100.0 * row.encode_share);
  }
}

void print_latencies(const measure::Report& report, std::size_t from) {
  if (report.latency.size() == from) return;
  std::printf("\n%-6s %-19s %-13s %4s %9s %7s %9s %9s %8s %8s %7s\n", "scene", "request", "beside", "thr.",
              "requests", "failed", "p50 ms", "p99 ms", "x p50", "x p99", "spread");
  for (std::size_t i = from; i < report.latency.size(); ++i) {
    const measure::LatencyRow& row = report.latency[i];
    std::printf("%-6s %-19s %-13s %4zu %9s %7s %9.3f %9.3f %8s %8s %5.1f %%\n", row.scene.c_str(),
                row.what.c_str(), row.beside.c_str(), row.threads, grouped(row.requests).c_str(),
                grouped(row.failed).c_str(), row.p50_ms, row.p99_ms, ratio_text(row.vs_base_p50).c_str(),
                ratio_text(row.vs_base_p99).c_str(), 100.0 * row.spread);
  }
}

void print_loads(const measure::Report& report, std::size_t from) {
  if (report.load.size() == from) return;
  std::printf("\n%-6s %-8s %-7s %4s %9s %9s %7s %7s %7s %8s %8s %9s %9s %8s %8s %7s %8s %8s %7s\n", "scene",
              "load", "clients", "thr.", "offered/s", "good/s", "x peak", "spread", "by CPU", "p50 ms",
              "p99 ms", "x steady", "refused/s", "p50 ms", "p99 ms", "failed", "late ms", "theirs",
              "again s");
  for (std::size_t i = from; i < report.load.size(); ++i) {
    const measure::LoadRow& row = report.load[i];
    std::printf(
        "%-6s %-8s %-7s %4zu %9.1f %9.1f %7s %5.1f %% %7s %8.2f %8.2f %9s %9.1f %8.2f %8.2f %7s %8.2f %6.1f "
        "%% "
        "%7.2f\n",
        row.scene.c_str(), row.phase.c_str(), measure::to_string(row.clients), row.threads, row.offered_per_s,
        row.goodput_per_s, ratio_text(row.vs_peak).c_str(), 100.0 * row.spread,
        ratio_text(row.vs_peak_by_cpu).c_str(), row.accepted_p50_ms, row.accepted_p99_ms,
        ratio_text(row.vs_steady_p99).c_str(), row.refused_per_s, row.refused_p50_ms, row.refused_p99_ms,
        grouped(row.failed + row.not_sent).c_str(), row.late_p99_ms, 100.0 * row.clients_share,
        row.recovery_s);
  }
}

void print_gone(const measure::Report& report, std::size_t from) {
  if (report.gone.size() == from) return;
  std::printf("\n%-6s %-11s %4s %10s %7s %9s %9s %9s\n", "scene", "client gone", "thr.", "rays", "trials",
              "median ms", "p99 ms", "worst ms");
  for (std::size_t i = from; i < report.gone.size(); ++i) {
    const measure::GoneRow& row = report.gone[i];
    std::printf("%-6s %-11s %4zu %10s %7s %9.1f %9.1f %9.1f\n", row.scene.c_str(), "", row.threads,
                grouped(row.rays).c_str(), grouped(row.trials).c_str(), row.median_ms, row.p99_ms,
                row.worst_ms);
  }
}

}  // namespace

void print_new_rows(const measure::Report& report, measure::Report& printed) {
  print_rays(report, printed.rays.size());
  print_checks(report, printed.checks.size());
  print_builds(report, printed.build.size());
  print_refits(report, printed.refit.size());
  print_instances(report, printed.instances.size());
  print_deformations(report, printed.deform_summary.size());
  print_serve(report, printed.serve.size());
  print_crowds(report, printed.crowd.size());
  print_json_batches(report, printed.json_batches.size());
  print_latencies(report, printed.latency.size());
  print_loads(report, printed.load.size());
  print_gone(report, printed.gone.size());
  std::fflush(stdout);
  printed = report;
}

}  // namespace gridcast::server
