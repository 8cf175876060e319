#include <algorithm>
#include <atomic>
#include <new>
#include <numeric>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/scene/pose.h"
#include "core/scene/scene_editor.h"

namespace gridcast::scene {
namespace {

/// Instances named one by one in the warnings; the rest is counted in one sentence.
constexpr std::size_t kMaxNamedWarnings = 20;
/// Instances per task: whole chunks of the slots, so that tasks write different ones.
constexpr std::size_t kInstancesPerTask = 4096;
/// Share of the work given to structures in the progress; the rest is the instances.
constexpr double kMeshShare = 0.9;

Error cancelled() {
  return {ErrorCode::kCancelled, "the build was cancelled", ""};
}

Error in_mesh(std::size_t mesh_id, const Error& error) {
  return {error.code, error.message, "/meshes/" + std::to_string(mesh_id) + error.where};
}

Status check_instances(const SceneData& data) {
  if (data.instances.size() >= kInvalidId)
    return Error{ErrorCode::kLimitExceeded, "more than 2^32 - 2 instances", "/instances"};
  for (std::size_t i = 0; i < data.instances.size(); ++i) {
    if (data.instances[i].mesh_id < data.meshes.size()) continue;
    return Error{ErrorCode::kInvalidArgument, "the instance names a mesh that does not exist",
                 "/instances/" + std::to_string(i) + "/mesh_id"};
  }
  return ok_status();
}

/// Meshes that deform are going to be refitted: their trees share no triangle between leaves.
blas::BuildOptions options_for(const RigMesh& mesh, blas::BuildOptions options) {
  if (mesh.deforms) {
    options.motion = blas::MeshMotion::kDeforms;
    options.spatial = blas::SpatialSplits::kNever;
  }
  return options;
}

/// What structures are built over: the file's meshes, bent as its nodes stand.
struct Sources {
  const SceneData& data;
  const Rig& rig;
  const Pose& pose;

  [[nodiscard]] std::size_t triangle_count(std::size_t mesh_id) const {
    return data.meshes[rig.meshes[mesh_id].source_mesh]->triangle_count();
  }
  /// The file's own mesh where that is what the rest pose looks like.
  [[nodiscard]] std::shared_ptr<const mesh::TriangleMesh> mesh_at_rest(std::size_t mesh_id) const {
    const RigMesh& rigged = rig.meshes[mesh_id];
    const auto& source = data.meshes[rigged.source_mesh];
    const bool morphs = std::ranges::any_of(rigged.weights, [](float weight) { return weight != 0.F; });
    if (rigged.skin_id == kInvalidId && !morphs) return source;
    std::vector<Affine> joints;
    if (rigged.skin_id != kInvalidId) joints = joint_matrices(data, rig, pose, rigged.skin_id);
    mesh::DeformedVertices bent = posed_vertices(data, rig, pose, std::uint32_t(mesh_id), joints);
    auto mesh = std::make_shared<mesh::TriangleMesh>(*source);
    mesh->positions = std::move(bent.positions);
    mesh->normals = std::move(bent.normals);
    return mesh;
  }
};

using BuiltMeshes = std::vector<Result<blas::Blas>>;

/// Checks and builds every mesh, the largest first so that the last task is a small one.
BuiltMeshes build_meshes(const Sources& sources, const SceneBuildOptions& options) {
  const std::size_t count = sources.rig.meshes.size();
  BuiltMeshes built(count, Result<blas::Blas>(cancelled()));
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return sources.triangle_count(a) > sources.triangle_count(b);
  });
  double total = 1.0;
  for (std::size_t id = 0; id < count; ++id) total += double(sources.triangle_count(id));

  std::atomic<std::size_t> done_triangles = 0;
  const auto build_one = [&](std::size_t rank) {
    const std::size_t id = order[rank];
    if (options.stop.stop_requested()) return;
    const auto mesh = sources.mesh_at_rest(id);
    if (Status valid = mesh::validate(*mesh); !valid) {
      built[id] = valid.error();
      return;
    }
    built[id] = blas::Blas::build(mesh, options_for(sources.rig.meshes[id], options.blas), options.stop);
    const std::size_t done = done_triangles += mesh->triangle_count();
    if (options.progress) options.progress(kMeshShare * double(done) / total);
  };
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, count, 1),
      [&](const auto& range) {
        for (std::size_t rank = range.begin(); rank < range.end(); ++rank) build_one(rank);
      },
      tbb::simple_partitioner());
  return built;
}

/// A skinned mesh stands where its joints are, whatever its node does (glTF 2.0, section 3.7.3.3).
Affine place_at_rest(const Sources& sources, std::size_t instance_id) {
  const std::uint32_t skin_id = sources.rig.meshes[sources.rig.mesh_of_instance[instance_id]].skin_id;
  return skin_id == kInvalidId ? sources.data.instances[instance_id].world_from_object
                               : skin_frame(sources.rig, skin_id, *sources.pose.nodes);
}

/// Fills the slots in parallel and collects their boxes.
std::vector<tlas::InstanceBox> place_instances(SceneEditor& editor, const Sources& sources) {
  const std::size_t count = sources.data.instances.size();
  std::vector<tlas::InstanceBox> boxes(count);
  editor.reserve_instances(count);
  const std::size_t tasks = (count + kInstancesPerTask - 1) / kInstancesPerTask;
  tbb::parallel_for(std::size_t(0), tasks, [&](std::size_t task) {
    const std::size_t end = std::min(count, (task + 1) * kInstancesPerTask);
    for (std::size_t i = task * kInstancesPerTask; i < end; ++i) {
      const auto id = std::uint32_t(i);
      editor.set_instance(id, InstanceTransform(place_at_rest(sources, i)),
                          {.mesh_id = sources.rig.mesh_of_instance[i]});
      boxes[i] = editor.hit_box_of(id);
    }
  });
  editor.count_instances();
  return boxes;
}

void warn_about_inactive(const Scene& scene, SceneData& data) {
  std::size_t inactive = 0;
  for (std::uint32_t id = 0; id < scene.instance_slots(); ++id) {
    if (scene.instance(id).transform.active()) continue;
    if (++inactive > kMaxNamedWarnings) continue;
    const std::string& name = data.instances[id].name.str();
    data.warnings.push_back("Instance " + std::to_string(id) + (name.empty() ? "" : " (" + name + ")") +
                            " has a singular or out-of-range transform and is never hit.");
  }
  if (inactive > kMaxNamedWarnings) {
    data.warnings.push_back(std::to_string(inactive - kMaxNamedWarnings) +
                            " more instances have a singular or out-of-range transform.");
  }
}

}  // namespace

Result<std::shared_ptr<const Scene>> build_scene(SceneData data, const SceneBuildOptions& options) try {
  if (Status status = check_instances(data); !status) return status.error();
  if (Status status = check_rig(data); !status) return status.error();
  const auto rig = std::make_shared<const Rig>(make_rig(data));
  const auto pose = std::make_shared<const Pose>(rest_pose(data, *rig));
  const Sources sources{data, *rig, *pose};
  BuiltMeshes built = build_meshes(sources, options);
  // The first invalid mesh by number, whatever the order of building; a cancelled build has no other error.
  if (options.stop.stop_requested()) return cancelled();
  SceneEditor editor;
  editor.set_blas_options(options.blas);
  for (std::size_t id = 0; id < built.size(); ++id) {
    if (!built[id]) return in_mesh(id, built[id].error());
    editor.add_mesh(*std::move(built[id]));
  }

  const std::vector<tlas::InstanceBox> boxes = place_instances(editor, sources);
  if (options.stop.stop_requested()) return cancelled();
  editor.set_top_level(tlas::TopLevel::build(boxes));
  warn_about_inactive(editor.scene(), data);
  editor.set_data(std::make_shared<const SceneData>(std::move(data)), rig);
  editor.set_pose(pose);
  if (options.progress) options.progress(1.0);
  return editor.publish();
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the scene", ""};
}

}  // namespace gridcast::scene
