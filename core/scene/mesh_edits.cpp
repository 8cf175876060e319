#include "core/scene/mesh_edits.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "core/blas/triangle_boxes.h"
#include "core/mesh/topology.h"
#include "core/scene/tree_watch.h"

namespace gridcast::scene {
namespace {

using Clock = std::chrono::steady_clock;

Error invalid(std::string message, std::string where) {
  return {ErrorCode::kInvalidArgument, std::move(message), std::move(where)};
}

/// Each id in range and named once.
Status check_vertex_ids(const std::vector<std::uint32_t>& ids, std::size_t vertex_count) {
  std::vector<bool> named(vertex_count, false);
  for (std::size_t k = 0; k < ids.size(); ++k) {
    const std::string where = "/vertex_ids/" + std::to_string(k);
    if (ids[k] >= vertex_count)
      return invalid("the mesh has only " + std::to_string(vertex_count) + " vertices", where);
    if (named[ids[k]]) return invalid("vertex " + std::to_string(ids[k]) + " is named twice", where);
    named[ids[k]] = true;
  }
  return ok_status();
}

Status check_edit(const ReplaceVertices& edit, std::size_t vertex_count) {
  const bool sparse = !edit.vertex_ids.empty();
  const std::size_t expected = sparse ? edit.vertex_ids.size() : vertex_count;
  if (edit.positions.size() != expected) {
    return invalid(
        "expected " + std::to_string(expected) + " positions, got " + std::to_string(edit.positions.size()),
        "/positions");
  }
  if (Status status = mesh::validate_positions(edit.positions); !status) return status;
  return check_vertex_ids(edit.vertex_ids, vertex_count);
}

/// The mesh with new positions, normals that came with them or match them, and the next vertex_version.
std::shared_ptr<const mesh::TriangleMesh> moved_mesh(const mesh::TriangleMesh& old,
                                                     std::vector<Vec3f> positions,
                                                     std::vector<Vec3f> normals) {
  auto moved = std::make_shared<mesh::TriangleMesh>();
  moved->name = old.name;
  moved->triangles = old.triangles;
  moved->parts = old.parts;
  moved->topology_version = old.topology_version;
  moved->vertex_version = old.vertex_version + 1;
  moved->positions = std::move(positions);
  moved->normals = std::move(normals);
  if (!old.normals.empty() && moved->normals.empty()) moved->normals = mesh::smooth_normals(*moved);
  return moved;
}

struct Action {
  blas::Blas blas;
  MeshAction kind;
  std::string reason;
};

using blas::MeshMotion;

Result<Action> rebuild(const blas::Blas& old, std::shared_ptr<const mesh::TriangleMesh> moved,
                       MeshMotion motion, const TreeForm& form, std::string reason) {
  blas::BuildOptions options = old.options();
  options.spatial = form.spatial;
  options.motion = motion;
  options.quality = form.quality;
  auto built = blas::Blas::build(std::move(moved), options);
  if (!built) return built.error();
  return Action{*std::move(built), MeshAction::kRebuild, std::move(reason)};
}

using Vertices = std::optional<std::vector<std::uint32_t>>;

/// Whoever has a kd-tree rebuilt wants a kd-tree: it is made as if for a mesh that stays.
MeshMotion motion_when_asked(const blas::Blas& old) {
  return old.options().kind == blas::StructureKind::kKdTree ? MeshMotion::kStatic : MeshMotion::kDeforms;
}

/// A structure that cannot be refitted gives way to one that follows the vertices from now on. In the quick
/// form where a better one comes later.
Result<Action> replace_kind(const blas::Blas& old, std::shared_ptr<const mesh::TriangleMesh> moved,
                            const TreeTerms& terms) {
  const double boxes = blas::triangle_boxes_per_ray(*moved, moved->bounds());
  const TreeForm form = terms.place == RebuildPlace::kInBackground
                            ? quick_form(boxes, moved->triangle_count(), terms.asked)
                            : best_form(boxes, terms.asked);
  auto action = rebuild(old, std::move(moved), MeshMotion::kDeforms, form, "");
  if (!action) return action;
  const auto before = old.stats().kind, now = action->blas.stats().kind;
  action->reason = "A " + std::string(to_string(before)) + " structure cannot be refitted" +
                   (before == now ? "." : ": a " + std::string(to_string(now)) + " takes its place.");
  return action;
}

/// What `refitted`, which is no longer good, becomes when the subtrees that made it so are built anew.
/// Nothing where that would not do, and for small meshes, whose rebuilds take a few milliseconds.
std::optional<Action> repaired(const blas::Blas& refitted, const TreeTerms& terms) {
  if (refitted.stats().triangle_count <= kFastRebuildTriangles) return std::nullopt;
  auto repair = refitted.repair();
  if (!repair || repair->outcome != blas::RepairOutcome::kRepaired ||
      judge_refit(repair->blas.stats(), terms).rebuild_as)
    return std::nullopt;
  return Action{std::move(repair->blas), MeshAction::kRefit,
                "Refitted, and " + std::to_string(repair->triangles) + " triangles in " +
                    std::to_string(repair->subtrees) +
                    " subtrees built anew, which had become worse than at build."};
}

/// The decision of UpdateMode: refit, or rebuild with a reason. `vertices` may differ; none = any.
Result<Action> refit_or_rebuild(const blas::Blas& old, std::shared_ptr<const mesh::TriangleMesh> moved,
                                const Vertices& vertices, UpdateMode mode, const TreeTerms& terms) {
  if (mode == UpdateMode::kRebuild) {
    const TreeForm form = best_form(blas::triangle_boxes_per_ray(*moved, moved->bounds()), terms.asked);
    return rebuild(old, std::move(moved), motion_when_asked(old), form, "A rebuild was asked for.");
  }
  if (!old.can_refit()) {
    if (mode == UpdateMode::kRefit && old.options().kind != blas::StructureKind::kAuto)
      return Error{ErrorCode::kUnsupported,
                   "a " + std::string(to_string(old.stats().kind)) + " structure cannot be refitted", ""};
    return replace_kind(old, std::move(moved), terms);
  }
  auto refitted = vertices ? old.refit(moved, *vertices) : old.refit(moved);
  if (!refitted) return refitted.error();
  if (mode == UpdateMode::kRefit)
    return Action{*std::move(refitted), MeshAction::kRefit, "A refit was asked for."};

  TreeVerdict verdict = judge_refit(refitted->stats(), terms);
  if (verdict.rebuild_as) {
    if (auto action = repaired(*refitted, terms)) return *std::move(action);
    return rebuild(old, std::move(moved), MeshMotion::kDeforms, *verdict.rebuild_as,
                   std::move(verdict.reason));
  }
  return Action{*std::move(refitted), MeshAction::kRefit, std::move(verdict.reason)};
}

}  // namespace

Status MeshEdits::add(const Scene& scene, const ReplaceVertices& edit, std::size_t edit_index) {
  if (edit.mesh_id >= scene.mesh_count())
    return Error{ErrorCode::kNotFound, "there is no mesh " + std::to_string(edit.mesh_id), "/mesh_id"};
  const mesh::TriangleMesh& mesh = scene.blas(edit.mesh_id).mesh();
  if (Status status = check_edit(edit, mesh.positions.size()); !status) return status;

  Pending& pending = pending_[edit.mesh_id];
  pending.normals.clear();
  if (edit.vertex_ids.empty()) {
    pending.positions = edit.positions;
    pending.vertices.reset();
  } else {
    if (pending.edit_count == 0) {
      pending.positions = mesh.positions;
      pending.vertices.emplace();
    }
    if (pending.vertices)
      pending.vertices->insert(pending.vertices->end(), edit.vertex_ids.begin(), edit.vertex_ids.end());
    for (std::size_t k = 0; k < edit.vertex_ids.size(); ++k)
      pending.positions[edit.vertex_ids[k]] = edit.positions[k];
  }
  ++pending.edit_count;
  // The most definite wish of the composed edits wins: rebuild, then refit, then auto.
  pending.mode = std::max(pending.mode, edit.mode);
  if (edit.mode == UpdateMode::kRefit) pending.last_refit_edit = edit_index;
  mesh_of_edit_.push_back(edit.mesh_id);
  return ok_status();
}

Status MeshEdits::pose(std::uint32_t mesh_id, mesh::DeformedVertices vertices, UpdateMode mode,
                       std::size_t edit_index) {
  if (Status status = mesh::validate_positions(vertices.positions); !status) return status;
  Pending& pending = pending_[mesh_id];
  pending.positions = std::move(vertices.positions);
  pending.normals = std::move(vertices.normals);
  pending.vertices.reset();
  ++pending.edit_count;
  pending.mode = std::max(pending.mode, mode);
  if (mode == UpdateMode::kRefit) pending.last_refit_edit = edit_index;
  return ok_status();
}

Status MeshEdits::apply(SceneEditor& editor) {
  std::vector<std::pair<const std::uint32_t, Pending>*> meshes;
  meshes.reserve(pending_.size());
  for (auto& mesh : pending_) meshes.push_back(&mesh);
  std::vector<Status> outcomes(meshes.size(), ok_status());
  tbb::parallel_for(std::size_t(0), meshes.size(), [&](std::size_t i) {
    // Isolated: who waits for loops of this mesh begins no other, or the other's time was told as this one's.
    tbb::this_task_arena::isolate([&] { outcomes[i] = apply(editor, meshes[i]->first, meshes[i]->second); });
  });
  const auto failed = std::ranges::find_if(outcomes, [](const Status& status) { return !status.ok(); });
  return failed == outcomes.end() ? ok_status() : *failed;
}

Status MeshEdits::apply(SceneEditor& editor, std::uint32_t mesh_id, Pending& pending) const {
  const Clock::time_point start = Clock::now();
  const blas::Blas old = editor.scene().blas(mesh_id);
  const TreeTerms terms{old.options().quality, editor.scene().blas_options().quality, rebuilds_};
  auto action =
      refit_or_rebuild(old, moved_mesh(old.mesh(), std::move(pending.positions), std::move(pending.normals)),
                       pending.vertices, pending.mode, terms);
  if (!action) {
    const std::string edit = "/edits/" + std::to_string(pending.last_refit_edit);
    return Error{action.error().code, action.error().message, edit + "/mode"};
  }
  // Whoever asked for a refit and got one wants the tree of this shape.
  const bool is_kept = pending.mode == UpdateMode::kRefit && action->kind == MeshAction::kRefit;
  const bool wants =
      rebuilds_ == RebuildPlace::kInBackground && !is_kept && wants_better_tree(action->blas, terms.asked);
  if (wants) action->reason += " A better tree is being built.";
  pending.report = {mesh_id, action->kind, action->reason, wants, old.stats().cost, action->blas.stats().cost,
                    0.0};
  editor.set_mesh(mesh_id, std::move(action->blas));
  pending.report.ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  return ok_status();
}

std::vector<MeshUpdateReport> MeshEdits::reports() const {
  std::vector<MeshUpdateReport> reports;
  for (const std::uint32_t mesh_id : mesh_of_edit_) reports.push_back(pending_.at(mesh_id).report);
  return reports;
}

}  // namespace gridcast::scene
