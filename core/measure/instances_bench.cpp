// The section `instances`: what it takes to move all or some of them.

#include <memory>
#include <utility>

#include "core/measure/bench.h"
#include "core/measure/embree_yardstick.h"
#include "core/measure/interleave.h"
#include "core/measure/random.h"
#include "core/scene/update.h"
#include "core/tlas/top_level.h"

namespace gridcast::measure {
namespace {

/// Instances in new places: every `stride`-th one, a little aside.
struct Pose {
  std::vector<scene::SceneEdit> edits;
  std::vector<EmbreeScene::Move> moves;
};

Pose make_pose(const BenchScene& scene, std::size_t stride, std::uint64_t seed) {
  Random random(seed);
  Pose pose;
  scene::MoveInstances edit;
  for (std::size_t i = 0; i < scene.data.instances.size(); i += stride) {
    Affine placed = scene.data.instances[i].world_from_object;
    if (!InstanceTransform(placed).active()) continue;
    placed.translation += random.in_box(0.1);
    edit.moves.push_back({std::uint32_t(i), placed});
    pose.moves.push_back({std::uint32_t(i), placed});
  }
  pose.edits.emplace_back(std::move(edit));
  return pose;
}

struct UpdateContender {
  InstanceRow row;
  bool makes_blocks = false;  ///< all of the grid, which would else be made when rays come to them
  std::shared_ptr<const scene::Scene> ours;  ///< the newest version
  std::unique_ptr<EmbreeScene> theirs;
  std::shared_ptr<const scene::Scene> old;  ///< let go of after the clock has stopped
};

Timed timed_update(UpdateContender& contender, const std::array<Pose, 2>& poses) {
  Timed timed;
  timed.run = [&contender, &poses, turn = std::size_t(0)]() mutable {
    const Pose& pose = poses[turn++ % 2];
    if (contender.theirs) return contender.theirs->move_instances(pose.moves);
    auto updated = scene::apply_update(*contender.ours, pose.edits);
    if (!updated) return Status(updated.error());
    contender.old = std::exchange(contender.ours, updated->scene);
    if (contender.makes_blocks) static_cast<void>(contender.ours->top_level().kind());
    return ok_status();
  };
  timed.after = [&contender] { contender.old.reset(); };
  return timed;
}

/// The top level alone, from boxes: what a whole rebuild costs beside the transforms.
Timed timed_build(const std::vector<tlas::InstanceBox>& boxes, tlas::TopLevel& built) {
  Timed timed;
  timed.before = [&built] { built = {}; };
  timed.run = [&boxes, &built] {
    built = tlas::TopLevel::build(boxes);
    return ok_status();
  };
  return timed;
}

class InstancesOfScene {
 public:
  InstancesOfScene(const BenchScene& from, const BenchOptions& options, Report& report,
                   const scene::ProgressCallback& progress)
      : from_(from), options_(options), report_(report), progress_(progress) {}

  Status run(std::size_t threads) {
    auto built = scene::build_scene(from_.data, {{}, options_.stop, {}});
    if (!built) return built.error();
    scene_ = *std::move(built);
    for (std::uint32_t i = 0; i < scene_->instance_slots(); ++i) boxes_.push_back(scene_->top_level().box(i));
    if (Status status = updates(threads, "all_moved", 1); !status) return status;
    return updates(threads, "one_percent_moved", 100);
  }

 private:
  InstanceRow row(std::size_t threads, std::string engine, std::string structure, std::string update) const {
    InstanceRow row;
    row.scene = from_.name;
    row.engine = std::move(engine);
    row.structure = std::move(structure);
    row.update = std::move(update);
    row.threads = threads;
    row.instances = from_.data.instances.size();
    row.moved = row.instances;
    return row;
  }

  Status updates(std::size_t threads, const std::string& update, std::size_t stride) {
    const std::array poses{make_pose(from_, stride, options_.seed),
                           make_pose(from_, stride, options_.seed + 1)};
    const std::string kind(tlas::to_string(scene_->top_level().kind()));
    std::vector<UpdateContender> contenders(stride == 1 ? 4 : 3);
    for (std::size_t i = 0; i < 2; ++i) {
      const EmbreeQuality quality = i == 0 ? EmbreeQuality::kLow : EmbreeQuality::kMedium;
      auto built = EmbreeScene::build(from_.data, {.quality = quality, .use = EmbreeUse::kDynamic});
      if (!built) return built.error();
      contenders[i].row = row(threads, "embree", std::string(to_string(quality)), update);
      contenders[i].theirs = *std::move(built);
    }
    for (std::size_t i = 2; i < contenders.size(); ++i) {
      contenders[i].makes_blocks = i == 3;
      contenders[i].row = row(threads, "gridcast", kind, i == 3 ? update + "_and_looked_at" : update);
      contenders[i].ours = scene_;
    }
    std::vector<Timed> timed;
    for (UpdateContender& contender : contenders) {
      contender.row.moved = poses[0].moves.size();
      timed.push_back(timed_update(contender, poses));
    }
    tlas::TopLevel built;
    if (stride == 1) timed.push_back(timed_build(boxes_, built));
    if (Status status = interleave(timed, threads, clock_for(threads), options_, progress_); !status)
      return status;
    std::vector<InstanceRow> rows;
    rows.reserve(timed.size());
    for (UpdateContender& contender : contenders) rows.push_back(contender.row);
    if (stride == 1) rows.push_back(row(threads, "gridcast", kind, "build"));
    finish(rows, timed, contenders);
    return ok_status();
  }

  void finish(std::vector<InstanceRow>& rows, const std::vector<Timed>& timed,
              const std::vector<UpdateContender>& contenders) {
    const bool low_wins = median(timed[0].seconds) < median(timed[1].seconds);
    const double count = double(std::max<std::size_t>(1, from_.data.instances.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      InstanceRow& row = rows[i];
      row.ms = 1000.0 * median(timed[i].seconds);
      row.ns_per_moved = 1e6 * row.ms / double(std::max<std::uint64_t>(1, row.moved));
      row.spread = spread(timed[i].seconds);
      row.bytes_per_instance =
          i < 2 ? double(contenders[i].theirs->memory_bytes() - mesh_bytes(*contenders[i].theirs)) / count
                : double(scene_->top_level().memory_bytes()) / count +
                      double(scene::InstanceTable::kBytesPerInstance);
      row.vs_embree = speedup(timed[i].seconds, timed[low_wins ? 0 : 1].seconds);
      report_.instances.push_back(row);
    }
  }

  /// Of Embree's trees of the meshes alone.
  [[nodiscard]] std::size_t mesh_bytes(const EmbreeScene& scene) const {
    return std::min(scene.memory_bytes(), scene.mesh_memory_bytes());
  }

  const BenchScene& from_;
  const BenchOptions& options_;
  Report& report_;
  const scene::ProgressCallback& progress_;
  std::shared_ptr<const scene::Scene> scene_;
  std::vector<tlas::InstanceBox> boxes_;
};

}  // namespace

Status bench_instances(const BenchScene& bench_scene, const BenchOptions& options, Report& report,
                       const scene::ProgressCallback& progress) {
  if (is_single_mesh(bench_scene.data)) return ok_status();
  for (const std::size_t threads : options.threads) {
    if (Status status = InstancesOfScene(bench_scene, options, report, progress).run(threads); !status)
      return status;
  }
  return ok_status();
}

}  // namespace gridcast::measure
