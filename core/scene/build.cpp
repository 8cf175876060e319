#include <algorithm>
#include <atomic>
#include <new>
#include <numeric>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

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

/// Meshes with morph targets or joints are going to be refitted: their trees share no triangle between
/// leaves.
blas::BuildOptions options_for(const SceneData& data, std::size_t mesh_id, blas::BuildOptions options) {
  if (mesh_id < data.deformations.size() && !data.deformations[mesh_id].empty()) {
    options.motion = blas::MeshMotion::kDeforms;
    options.spatial = blas::SpatialSplits::kNever;
  }
  return options;
}

using BuiltMeshes = std::vector<Result<blas::Blas>>;

/// Checks and builds every mesh, the largest first so that the last task is a small one.
BuiltMeshes build_meshes(const SceneData& data, const SceneBuildOptions& options) {
  const std::size_t count = data.meshes.size();
  BuiltMeshes built(count, Result<blas::Blas>(cancelled()));
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return data.meshes[a]->triangle_count() > data.meshes[b]->triangle_count();
  });
  double total = 1.0;
  for (const auto& mesh : data.meshes) total += double(mesh->triangle_count());

  std::atomic<std::size_t> done_triangles = 0;
  const auto build_one = [&](std::size_t rank) {
    const std::size_t id = order[rank];
    if (options.stop.stop_requested()) return;
    const auto& mesh = data.meshes[id];
    if (Status valid = mesh::validate(*mesh); !valid) {
      built[id] = valid.error();
      return;
    }
    built[id] = blas::Blas::build(mesh, options_for(data, id, options.blas), options.stop);
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

/// Fills the slots in parallel and collects their boxes.
std::vector<tlas::InstanceBox> place_instances(SceneEditor& editor, const SceneData& data) {
  const std::size_t count = data.instances.size();
  std::vector<tlas::InstanceBox> boxes(count);
  editor.reserve_instances(count);
  const std::size_t tasks = (count + kInstancesPerTask - 1) / kInstancesPerTask;
  tbb::parallel_for(std::size_t(0), tasks, [&](std::size_t task) {
    const std::size_t end = std::min(count, (task + 1) * kInstancesPerTask);
    for (std::size_t i = task * kInstancesPerTask; i < end; ++i) {
      const InstanceData& from = data.instances[i];
      const auto id = std::uint32_t(i);
      editor.set_instance(id, {InstanceTransform(from.world_from_object), from.mesh_id, true});
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
    const std::string& name = data.instances[id].name;
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
  BuiltMeshes built = build_meshes(data, options);
  // The first invalid mesh by number, whatever the order of building; a cancelled build has no other error.
  if (options.stop.stop_requested()) return cancelled();
  SceneEditor editor;
  editor.set_blas_options(options.blas);
  for (std::size_t id = 0; id < built.size(); ++id) {
    if (!built[id]) return in_mesh(id, built[id].error());
    editor.add_mesh(*std::move(built[id]));
  }

  const std::vector<tlas::InstanceBox> boxes = place_instances(editor, data);
  if (options.stop.stop_requested()) return cancelled();
  editor.set_top_level(tlas::TopLevel::build(boxes));
  warn_about_inactive(editor.scene(), data);
  editor.set_data(std::make_shared<const SceneData>(std::move(data)));
  if (options.progress) options.progress(1.0);
  return editor.publish();
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the scene", ""};
}

}  // namespace gridcast::scene
