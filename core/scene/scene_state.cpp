#include "core/scene/scene_state.h"

#include <algorithm>
#include <new>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/scene/rig.h"
#include "core/scene/scene_editor.h"

namespace gridcast::scene {

/// Reads what has to be kept of a scene's insides.
class SceneKeeper {
 public:
  static SceneState state_of(const Scene& scene) {
    const Kept kept = kept_of(scene);
    SceneState state{kept.version, kept.build, kept.data, kept.pose, {}, {}, {}, {}};
    for (const blas::Blas& blas : kept.blas) state.meshes.push_back({blas.mesh_ptr(), blas.options()});
    state.instances.reserve(kept.instances.size());
    for (std::uint32_t id = 0; id < kept.instances.size(); ++id)
      state.instances.push_back(state_of(kept.instances[id]));
    for (std::size_t i = 0; i < kept.added_names.size(); ++i)
      state.added_names.push_back({kept.added_names[i].instance_id, kept.added_names[i].name});
    if (kept.new_names != nullptr) state.new_names = *kept.new_names;
    return state;
  }

  static SceneDelta difference(const Scene& before, const Scene& after) {
    const Kept old = kept_of(before), now = kept_of(after);
    SceneDelta delta{now.version, pose_change(old, now), {}, {}, {}, name_changes(old, now)};
    constexpr std::uint32_t kChunk = InstanceTable::kChunkSize;
    for (std::uint32_t id = 0; id < now.instances.size(); ++id) {
      if (id % kChunk == 0 && now.instances.shares_chunk(old.instances, id)) {
        id += kChunk - 1;
        continue;
      }
      const InstanceState state = state_of(now.instances[id]);
      if (id < old.instances.size() && same(state, state_of(old.instances[id]))) continue;
      delta.instances.push_back({id, state});
    }
    for (std::size_t i = old.added_names.size(); i < now.added_names.size(); ++i)
      delta.added_names.push_back({now.added_names[i].instance_id, now.added_names[i].name});
    for (std::size_t i = 0; i < now.blas.size(); ++i) {
      const auto was = i < old.blas.size() ? old.blas[i].mesh_ptr() : nullptr;
      if (now.blas[i].mesh_ptr() == was) continue;
      delta.meshes.push_back({std::uint32_t(i), was, {now.blas[i].mesh_ptr(), now.blas[i].options()}});
    }
    return delta;
  }

 private:
  struct Kept {
    std::uint64_t version;
    const blas::BuildOptions& build;
    const std::vector<blas::Blas>& blas;
    const InstanceTable& instances;
    const ChunkedVector<Scene::AddedName, 64>& added_names;
    const std::shared_ptr<const std::map<std::uint32_t, std::string>>& new_names;
    const std::shared_ptr<const SceneData>& data;
    const std::shared_ptr<const Pose>& pose;
  };

  static Kept kept_of(const Scene& scene) {
    // Every member by name: a new one does not compile before it is decided here whether it is kept. Those
    // that are not follow from those that are.
    const auto& [version, build, blas, hulls, instances, added_names, new_names, live_instances,
                 world_triangles, top_level, data, rig, pose] = scene;
    return {version, build, blas, instances, added_names, new_names, data, pose};
  }

  static std::optional<Pose> pose_change(const Kept& old, const Kept& now) {
    if (now.pose == old.pose) return std::nullopt;
    Pose pose = *now.pose;
    if (pose.nodes == old.pose->nodes) pose.nodes = nullptr;
    return pose;
  }

  static std::map<std::uint32_t, std::string> name_changes(const Kept& old, const Kept& now) {
    if (now.new_names == old.new_names || now.new_names == nullptr) return {};
    std::map<std::uint32_t, std::string> changes = *now.new_names;
    if (old.new_names != nullptr)
      std::erase_if(changes, [&](const auto& entry) {
        const auto was = old.new_names->find(entry.first);
        return was != old.new_names->end() && was->second == entry.second;
      });
    return changes;
  }

  static InstanceState state_of(const Instance& instance) {
    return {instance.transform.world_from_object(), instance.mesh_id, instance.alive, instance.mask};
  }

  static bool same(const InstanceState& a, const InstanceState& b) {
    return a.world_from_object == b.world_from_object && a.mesh_id == b.mesh_id && a.alive == b.alive &&
           a.mask == b.mask;
  }
};

namespace {

/// Instances per task: whole chunks of the slots, so that tasks write different ones.
constexpr std::size_t kInstancesPerTask = 4096;

Error cancelled() {
  return {ErrorCode::kCancelled, "the build was cancelled", ""};
}

Status check_references(const SceneState& state) {
  for (std::size_t i = 0; i < state.instances.size(); ++i)
    if (state.instances[i].mesh_id >= state.meshes.size())
      return Error{ErrorCode::kInvalidArgument, "the instance names a mesh that does not exist",
                   "/instances/" + std::to_string(i) + "/mesh_id"};
  if (state.instances.size() < state.data->instances.size())
    return Error{ErrorCode::kInvalidArgument, "there are fewer instances than the file has", "/instances"};
  std::size_t next_id = state.data->instances.size();
  for (const InstanceName& named : state.added_names) {
    if (named.instance_id < next_id || named.instance_id >= state.instances.size())
      return Error{ErrorCode::kInvalidArgument, "names are not in the order of their instances",
                   "/added_names"};
    next_id = named.instance_id + std::size_t(1);
  }
  if (!state.new_names.empty() && state.new_names.rbegin()->first >= state.instances.size())
    return Error{ErrorCode::kInvalidArgument, "a name is that of an instance that does not exist",
                 "/new_names"};
  return ok_status();
}

bool fits(const Pose& pose, const SceneData& data, const Rig& rig) {
  const std::size_t nodes = data.nodes.size();
  if (pose.nodes == nullptr || pose.nodes->locals.size() != nodes || pose.nodes->parts.size() != nodes ||
      pose.nodes->worlds.size() != nodes)
    return false;
  const auto weights = rest_pose(data, rig).weights;
  const auto same_targets = [](const auto& a, const auto& b) {
    return a.first == b.first && a.second.size() == b.second.size();
  };
  const auto has_joints = [&](const auto& skin) {
    return skin.first < data.skins.size() && skin.second.size() == data.skins[skin.first].joints.size();
  };
  return std::ranges::equal(pose.weights, weights, same_targets) &&
         std::ranges::all_of(pose.joints, has_joints) &&
         (!pose.animation || pose.animation->animation_id < data.animations.size());
}

/// What next poses rely on.
Status check_pose(const SceneState& state, const Rig& rig) {
  if (state.meshes.size() < rig.meshes.size())
    return Error{ErrorCode::kInvalidArgument, "there are fewer meshes than the file has", "/meshes"};
  if (state.pose == nullptr || !fits(*state.pose, *state.data, rig))
    return Error{ErrorCode::kInvalidArgument, "the pose is that of another file", "/pose"};
  for (std::size_t id = 0; id < rig.meshes.size(); ++id)
    if (rig.meshes[id].deforms && state.meshes[id].mesh->positions.size() !=
                                      state.data->meshes[rig.meshes[id].source_mesh]->positions.size())
      return Error{ErrorCode::kInvalidArgument, "the mesh has another number of vertices than in the file",
                   "/meshes/" + std::to_string(id)};
  return ok_status();
}

Result<blas::Blas> build_mesh(const MeshState& state, const std::stop_token& stop,
                              const TreeFinder& find_tree) {
  if (stop.stop_requested()) return cancelled();
  if (Status valid = mesh::validate(*state.mesh); !valid) return valid.error();
  if (find_tree)
    if (auto found = find_tree(state)) return *std::move(found);
  return blas::Blas::build(state.mesh, state.build, stop);
}

std::vector<Result<blas::Blas>> build_meshes(const std::vector<MeshState>& meshes,
                                             const std::stop_token& stop, const TreeFinder& find_tree) {
  std::vector<Result<blas::Blas>> built(meshes.size(), Result<blas::Blas>(cancelled()));
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, meshes.size(), 1),
      [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i)
          built[i] = build_mesh(meshes[i], stop, find_tree);
      },
      tbb::simple_partitioner());
  return built;
}

void place_instances(SceneEditor& editor, const std::vector<InstanceState>& instances) {
  std::vector<tlas::InstanceBox> boxes(instances.size());
  editor.reserve_instances(instances.size());
  const std::size_t tasks = (instances.size() + kInstancesPerTask - 1) / kInstancesPerTask;
  tbb::parallel_for(std::size_t(0), tasks, [&](std::size_t task) {
    const std::size_t end = std::min(instances.size(), (task + 1) * kInstancesPerTask);
    for (std::size_t i = task * kInstancesPerTask; i < end; ++i) {
      const InstanceState& state = instances[i];
      editor.set_instance(std::uint32_t(i), InstanceTransform(state.world_from_object),
                          {state.mesh_id, state.alive, state.mask});
      boxes[i] = editor.hit_box_of(std::uint32_t(i));
    }
  });
  editor.count_instances();
  editor.set_top_level(tlas::TopLevel::build(boxes));
}

}  // namespace

SceneState state_of(const Scene& scene) {
  return SceneKeeper::state_of(scene);
}

SceneDelta difference(const Scene& before, const Scene& after) {
  return SceneKeeper::difference(before, after);
}

Result<std::shared_ptr<const Scene>> restore_scene(SceneState state, const SceneBuildOptions& options,
                                                   const TreeFinder& find_tree) try {
  if (Status status = check_rig(*state.data); !status) return status.error();
  if (Status status = check_references(state); !status) return status.error();
  auto rig = std::make_shared<const Rig>(make_rig(*state.data));
  if (Status status = check_pose(state, *rig); !status) return status.error();
  std::vector<Result<blas::Blas>> built = build_meshes(state.meshes, options.stop, find_tree);
  if (options.stop.stop_requested()) return cancelled();
  SceneEditor editor;
  editor.set_version(state.version);
  editor.set_blas_options(state.build);
  for (std::size_t id = 0; id < built.size(); ++id) {
    if (!built[id])
      return Error{built[id].error().code, built[id].error().message,
                   "/meshes/" + std::to_string(id) + built[id].error().where};
    editor.add_mesh(*std::move(built[id]));
  }
  place_instances(editor, state.instances);
  for (const InstanceName& named : state.added_names) editor.add_name(named.instance_id, named.name);
  for (const auto& [id, name] : state.new_names) editor.set_name(id, name);
  editor.set_data(std::move(state.data), std::move(rig));
  editor.set_pose(std::move(state.pose));
  return editor.publish();
} catch (const std::bad_alloc&) {
  return Error{ErrorCode::kLimitExceeded, "not enough memory for the scene", ""};
}

}  // namespace gridcast::scene
