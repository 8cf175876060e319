#include "proto/explain_reply.h"

#include <type_traits>

#include "proto/reply_columns.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

/// Writes the members of one object; commas are its own.
class Members {
 public:
  explicit Members(JsonText& text) : text_(text) { text_.raw("{"); }
  void end() { text_.raw("}"); }

  void word(std::string_view name, std::string_view value) {
    key(name);
    text_.raw("\"");
    text_.raw(value);
    text_.raw("\"");
  }
  template <class T>
  void number(std::string_view name, T value) {
    key(name);
    if constexpr (std::is_same_v<T, double>)
      write_bound(text_, value);
    else
      text_.number(value);
  }
  void number_or_null(std::string_view name, const std::optional<double>& value) {
    key(name);
    if (value) return text_.number(*value);
    text_.raw("null");
  }
  void flag(std::string_view name, bool value) {
    key(name);
    text_.raw(value ? "true" : "false");
  }
  template <class T>
  void list(std::string_view name, std::initializer_list<T> values) {
    key(name);
    text_.raw("[");
    for (const T& value : values) {
      if (&value != values.begin()) text_.raw(",");
      text_.number(value);
    }
    text_.raw("]");
  }
  void key(std::string_view name) {
    text_.raw(is_first_ ? "\"" : ",\"");
    text_.raw(name);
    text_.raw("\":");
    is_first_ = false;
  }

 private:
  JsonText& text_;
  bool is_first_ = true;
};

void write(Members& out, const CellStep& step) {
  out.word("kind", "cell");
  out.list("cell", {step.cell[0], step.cell[1], step.cell[2]});
  out.number("t_enter", step.t_enter);
  out.number("t_exit", step.t_exit);
  out.word("content", kCellContentNames[std::size_t(step.content)]);
  out.number("instances", step.instances);
  out.number("skipped_blocks", step.skipped_blocks);
}

void write(Members& out, const BlockStep& step) {
  out.word("kind", "block");
  out.list("block", {step.block[0], step.block[1], step.block[2]});
  out.number("t_enter", step.t_enter);
  out.number("t_exit", step.t_exit);
  out.number("instances", step.instances);
  out.number("skipped_blocks", step.skipped_blocks);
}

void write(Members& out, const CellNodeStep& step) {
  out.word("kind", "cell_node");
  out.number("depth", step.depth);
  out.number("t_enter", step.t_enter);
  out.number("children", step.children);
  out.number("children_hit", step.children_hit);
  out.number("stack", step.stack);
}

void write(Members& out, const InstanceStep& step) {
  out.word("kind", "instance");
  out.number("instance_id", step.instance_id);
  out.number("mesh_id", step.mesh_id);
  out.word("outcome", kInstanceOutcomeNames[std::size_t(step.outcome)]);
  out.number_or_null("t_enter", step.t_enter);
  if (!step.structure.empty()) out.word("structure", step.structure);
}

void write(Members& out, const NodeStep& step) {
  out.word("kind", "node");
  out.number("node", step.node);
  out.number("depth", step.depth);
  out.number("t_enter", step.t_enter);
  out.number("children", step.children);
  out.number("children_hit", step.children_hit);
  out.number("stack", step.stack);
}

void write(Members& out, const LeafStep& step) {
  out.word("kind", "leaf");
  out.number("leaf", step.leaf);
  out.number("depth", step.depth);
  out.number("t_enter", step.t_enter);
  out.number("triangles", step.triangles);
  out.number("stack", step.stack);
}

void write(Members& out, const TriangleStep& step) {
  out.word("kind", "triangle");
  out.number("primitive_id", step.primitive_id);
  out.word("verdict", kTriangleVerdictNames[std::size_t(step.verdict)]);
  out.number_or_null("t", step.t);
  out.flag("best", step.is_best);
}

void write(Members& out, const OpaqueStep& step) {
  out.word("kind", "opaque");
  out.word("structure", step.structure);
  out.flag("best", step.found_best);
}

void write_hit(JsonText& text, const SurfaceHit& hit) {
  if (!has_hit(hit.status)) return text.raw("null");
  Members out(text);
  out.number("t", hit.t);
  out.number("instance_id", hit.instance_id);
  out.number("mesh_id", hit.mesh_id);
  out.number("primitive_id", hit.primitive_id);
  out.list("uv", {float(hit.u), float(hit.v)});
  out.list("normal", {float(hit.normal.x), float(hit.normal.y), float(hit.normal.z)});
  out.end();
}

void write_counts(JsonText& text, const WayCounts& counts) {
  Members out(text);
  out.number("cells", counts.cells);
  out.number("blocks", counts.blocks);
  out.number("skipped_blocks", counts.skipped_blocks);
  out.number("cell_nodes", counts.cell_nodes);
  out.number("instances", counts.instances);
  out.number("passed_instances", counts.passed_instances);
  out.number("nodes", counts.nodes);
  out.number("leaves", counts.leaves);
  out.number("triangles", counts.triangles);
  out.number("filtered_triangles", counts.filtered_triangles);
  out.number("max_stack", counts.max_stack);
  out.end();
}

}  // namespace

std::string write_explain_json(const ExplainReply& reply) {
  constexpr std::size_t kBytesPerStep = 112;
  JsonText text(1024 + kBytesPerStep * reply.steps.size());
  Members out(text);
  out.word("scene_version", std::to_string(reply.scene_version));
  out.key("hit");
  write_hit(text, reply.hit);
  out.flag("truncated", reply.is_truncated);
  out.key("counts");
  write_counts(text, reply.counts);
  out.key("steps");
  text.raw("[");
  for (std::size_t i = 0; i < reply.steps.size(); ++i) {
    if (i != 0) text.raw(",");
    Members step(text);
    std::visit([&](const auto& one) { write(step, one); }, reply.steps[i]);
    step.end();
  }
  text.raw("]");
  out.end();
  return std::move(text).take();
}

}  // namespace gridcast::proto
