#include "server/cli/explain_text.h"

#include <cstdarg>
#include <cstdio>

#include "proto/vocabulary.h"
#include "server/cli/common.h"
#include "server/number_text.h"

namespace gridcast::server {
namespace {

/// Columns that a level is indented by.
constexpr std::size_t kIndent = 2;

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...) {
  char text[256];
  va_list values;
  va_start(values, pattern);
  std::vsnprintf(text, sizeof(text), pattern, values);
  va_end(values);
  return text;
}

/// "1 cell", "2 cells", "1,200 nodes".
std::string counted(std::uint64_t count, const std::string& what, const char* plural_ending = "s") {
  return grouped(count) + " " + what + (count == 1 ? "" : plural_ending);
}

std::string skipped(std::uint32_t blocks) {
  return blocks == 0 ? "" : ", after " + counted(blocks, "empty block");
}

class WayText {
 public:
  void operator()(const CellStep& step) {
    level_ = 1;
    line(0, format("cell (%u, %u, %u), t %.6g to %.6g: ", step.cell[0], step.cell[1], step.cell[2],
                   step.t_enter, step.t_exit) +
                (step.content == CellContent::kEmpty ? "empty" : counted(step.instances, "instance")) +
                (step.content == CellContent::kTree ? " in a tree" : "") + skipped(step.skipped_blocks));
  }
  void operator()(const BlockStep& step) {
    level_ = 1;
    line(0, format("block (%u, %u, %u) of cells, t %.6g to %.6g: ", step.block[0], step.block[1],
                   step.block[2], step.t_enter, step.t_exit) +
                counted(step.instances, "instance") + skipped(step.skipped_blocks));
  }
  void operator()(const CellNodeStep& step) {
    level_ = 2 + int(step.depth);
    line(level_ - 1, format("boxes, t %.6g: %u of %u hit, %u waiting", step.t_enter, step.children_hit,
                            step.children, step.stack));
  }
  void operator()(const InstanceStep& step) {
    std::string text = "instance " + std::to_string(step.instance_id) + " of mesh " +
                       std::to_string(step.mesh_id) + ": " + words(step.outcome);
    if (step.t_enter) text += format(", t %.6g", *step.t_enter);
    if (!step.structure.empty()) text.append(", ").append(step.structure);
    line(level_, text);
    triangle_level_ = level_ + 1;
  }
  void operator()(const NodeStep& step) {
    line(level_ + 1 + int(step.depth), format("node %u, t %.6g: %u of %u children hit, %u waiting", step.node,
                                              step.t_enter, step.children_hit, step.children, step.stack));
  }
  void operator()(const LeafStep& step) {
    line(level_ + 1 + int(step.depth), format("leaf %u, t %.6g: ", step.leaf, step.t_enter) +
                                           counted(step.triangles, "triangle") +
                                           format(", %u waiting", step.stack));
    triangle_level_ = level_ + 2 + int(step.depth);
  }
  void operator()(const TriangleStep& step) {
    std::string text = "triangle " + std::to_string(step.primitive_id) + ": " + words(step.verdict);
    if (step.t) text += format(", t %.9g", *step.t);
    if (step.is_best) text += ", the best so far";
    line(triangle_level_, text);
  }
  void operator()(const OpaqueStep& step) {
    line(level_ + 1, std::string(step.structure) + " does not show its way" +
                         (step.found_best ? ": it found the best hit so far" : ""));
  }
  [[nodiscard]] std::string take() && { return std::move(text_); }
  void line(int level, const std::string& text) {
    text_.append(kIndent * std::size_t(level), ' ').append(text).append("\n");
  }

 private:
  /// The wire's words without their underscores.
  static std::string spaced(std::string_view name) {
    std::string text(name);
    for (char& c : text)
      if (c == '_') c = ' ';
    return text;
  }
  static std::string words(InstanceOutcome outcome) {
    return spaced(proto::kInstanceOutcomeNames[std::size_t(outcome)]);
  }
  static std::string words(TriangleVerdict verdict) {
    return spaced(proto::kTriangleVerdictNames[std::size_t(verdict)]);
  }

  std::string text_;
  int level_ = 0;           ///< of instances
  int triangle_level_ = 1;  ///< of triangles
};

std::string hit_text(const SurfaceHit& hit) {
  if (hit.status != RayStatus::kHit) return "no hit";
  return format("hit at t %.17g: instance %u, mesh %u, triangle %u, u %.6g, v %.6g", hit.t, hit.instance_id,
                hit.mesh_id, hit.primitive_id, hit.u, hit.v);
}

std::string counts_text(const WayCounts& counts) {
  std::string text = counted(counts.cells, "cell");
  if (counts.blocks != 0) text += ", " + counted(counts.blocks, "block");
  if (counts.cell_nodes != 0) text += ", " + counted(counts.cell_nodes, "group") + " of boxes";
  return text + ", " + counted(counts.instances, "instance") + " entered and " +
         grouped(counts.passed_instances) + " passed over, " + counted(counts.nodes, "node") + ", " +
         grouped(counts.leaves) + (counts.leaves == 1 ? " leaf, " : " leaves, ") +
         counted(counts.triangles, "triangle") + " tested and " + grouped(counts.filtered_triangles) +
         " filtered out, at most " + grouped(counts.max_stack) + " waiting";
}

}  // namespace

std::string explain_text(const scene::Explanation& told) {
  WayText text;
  for (const WayStep& step : told.steps) std::visit(text, step);
  if (told.is_truncated)
    text.line(0, "... cut after " + counted(told.steps.size(), "step") + "; --max-steps shows more");
  text.line(0, hit_text(told.hit));
  text.line(0, counts_text(told.counts));
  return std::move(text).take();
}

}  // namespace gridcast::server
