#include "server/cli_bench_report.h"

#include <cstdio>

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

}  // namespace

void print_new_rows(const measure::Report& report, measure::Report& printed) {
  print_rays(report, printed.rays.size());
  print_checks(report, printed.checks.size());
  std::fflush(stdout);
  printed = report;
}

}  // namespace gridcast::server
