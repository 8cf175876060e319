#include "server/cli_bench_report.h"

#include <cstdio>

#include "server/cli_common.h"

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
  std::printf("\n%-6s %-9s %-15s %4s %11s %10s %9s %7s %9s %9s %8s %7s\n", "scene", "engine", "build", "thr.",
              "triangles", "ms", "Mtri/s", "spread", "bytes/tri", "mesh b/t", "x medium", "x low");
  for (std::size_t i = from; i < report.build.size(); ++i) {
    const measure::BuildRow& row = report.build[i];
    std::printf("%-6s %-9s %-15s %4zu %11s %10.2f %9.2f %5.1f %% %9.1f %9.1f %8s %7s\n", row.scene.c_str(),
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
  std::printf("\n%-6s %-17s %4s %10s %9s %7s %13s\n", "scene", "over HTTP", "thr.", "rays", "Mrays/s",
              "spread", "x in process");
  for (std::size_t i = from; i < report.serve.size(); ++i) {
    const measure::ServeRow& row = report.serve[i];
    std::printf("%-6s %-17s %4zu %10s %9.3f %5.1f %% %13s\n", row.scene.c_str(), row.set.c_str(), row.threads,
                grouped(row.rays).c_str(), row.mrays_per_s, 100.0 * row.spread,
                ratio_text(row.vs_in_process).c_str());
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
  std::fflush(stdout);
  printed = report;
}

}  // namespace gridcast::server
