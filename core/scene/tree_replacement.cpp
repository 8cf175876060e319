#include "core/scene/tree_replacement.h"

#include <algorithm>
#include <new>

#include "core/scene/scene_editor.h"
#include "core/scene/tree_watch.h"

namespace gridcast::scene {
namespace {

bool has_same_triangles(const mesh::TriangleMesh& a, const mesh::TriangleMesh& b) {
  return a.topology_version == b.topology_version && a.triangle_count() == b.triangle_count() &&
         a.positions.size() == b.positions.size();
}

}  // namespace

std::optional<TreeOrder> better_tree(const Scene& scene, std::uint32_t mesh_id) {
  if (mesh_id >= scene.mesh_count()) return std::nullopt;
  const blas::Blas& present = scene.blas(mesh_id);
  const blas::BuildQuality asked = scene.blas_options().quality;
  if (!wants_better_tree(present, asked)) return std::nullopt;
  TreeOrder order{present.mesh_ptr(), present.options()};
  const TreeForm form = best_form(boxes_per_ray(present.stats()), asked);
  order.options.quality = form.quality;
  order.options.spatial = form.spatial;
  order.options.motion = blas::MeshMotion::kDeforms;
  return order;
}

std::vector<std::uint32_t> wanted_trees(const UpdateReport& report) {
  std::vector<std::uint32_t> ids;
  const auto collect = [&ids](const std::vector<MeshUpdateReport>& meshes) {
    for (const MeshUpdateReport& mesh : meshes)
      if (mesh.wants_better_tree) ids.push_back(mesh.mesh_id);
  };
  collect(report.meshes);
  for (const PoseReport& pose : report.poses) collect(pose.meshes);
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  return ids;
}

Result<blas::Blas> caught_up(const blas::Blas& tree, const Scene& scene, std::uint32_t mesh_id) {
  const auto& mesh = scene.blas(mesh_id).mesh_ptr();
  if (tree.mesh_ptr() == mesh) return tree;
  return tree.refit(mesh);
}

Result<std::variant<std::shared_ptr<const Scene>, TreeRefusal>> replace_tree(const Scene& scene,
                                                                             std::uint32_t mesh_id,
                                                                             const blas::Blas& tree) try {
  using Outcome = std::variant<std::shared_ptr<const Scene>, TreeRefusal>;
  if (mesh_id >= scene.mesh_count()) return Outcome(TreeRefusal::kMeshChanged);
  const blas::Blas& present = scene.blas(mesh_id);
  if (!has_same_triangles(present.mesh(), tree.mesh()) || present.stats().kind != tree.stats().kind)
    return Outcome(TreeRefusal::kMeshChanged);
  auto caught = caught_up(tree, scene, mesh_id);
  if (!caught) return caught.error();
  if (!(caught->stats().cost < present.stats().cost)) return Outcome(TreeRefusal::kNotBetter);
  SceneEditor editor(scene);
  editor.set_version(scene.version());
  editor.set_tree(mesh_id, *std::move(caught));
  return Outcome(editor.publish());
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the tree", ""};
}

}  // namespace gridcast::scene
