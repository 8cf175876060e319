#include "server/tree_builder.h"

#include <algorithm>

#include <tbb/task_arena.h>

#include "core/scene/tree_replacement.h"
#include "server/scene_store.h"

namespace gridcast::server {
namespace {

/// The longest that a mesh which keeps moving waits for the next try.
constexpr std::chrono::duration<double, std::milli> kLongestWait{10'000.0};
constexpr unsigned kMostDoublings = 16;

}  // namespace

TreeBuilder::TreeBuilder(std::size_t threads)
    : build_threads_(int(std::max<std::size_t>(1, threads / 4))),
      thread_([this](const std::stop_token& ending) { work(ending); }) {}

TreeBuilder::~TreeBuilder() {
  shut_down();
}

void TreeBuilder::shut_down() {
  thread_.request_stop();
}

void TreeBuilder::want(const std::shared_ptr<NamedScene>& scene, std::uint32_t mesh_id) {
  {
    const std::lock_guard lock(mutex_);
    if (Wish* wish = find(*scene, mesh_id)) {
      wish->parked = false;
    } else {
      auto own = std::ranges::find_if(scenes_, [&](const auto& s) { return s.scene.lock() == scene; });
      if (own == scenes_.end()) own = scenes_.insert(scenes_.end(), {scene, {}});
      own->wishes.push_back({.mesh_id = mesh_id});
    }
    ++changes_;
  }
  changed_.notify_all();
}

TreeBuildCounts TreeBuilder::counts() const {
  const std::lock_guard lock(mutex_);
  TreeBuildCounts counts = counts_;
  for (const SceneWishes& scene : scenes_) {
    if (scene.scene.expired()) continue;
    counts.waiting += std::size_t(std::ranges::count(scene.wishes, false, &Wish::parked));
  }
  return counts;
}

TreeBuilder::Wish* TreeBuilder::find(const NamedScene& scene, std::uint32_t mesh_id) {
  for (SceneWishes& own : scenes_) {
    if (own.scene.lock().get() != &scene) continue;
    const auto wish = std::ranges::find(own.wishes, mesh_id, &Wish::mesh_id);
    return wish == own.wishes.end() ? nullptr : &*wish;
  }
  return nullptr;
}

void TreeBuilder::forget(const NamedScene& scene, std::uint32_t mesh_id) {
  for (SceneWishes& own : scenes_)
    if (own.scene.lock().get() == &scene)
      std::erase_if(own.wishes, [mesh_id](const Wish& wish) { return wish.mesh_id == mesh_id; });
  std::erase_if(scenes_, [](const SceneWishes& own) { return own.wishes.empty(); });
}

std::optional<TreeBuilder::Task> TreeBuilder::take() {
  std::erase_if(scenes_, [](const SceneWishes& own) { return own.scene.expired(); });
  const Clock::time_point now = Clock::now();
  for (auto own = scenes_.begin(); own != scenes_.end(); ++own) {
    const auto wish =
        std::ranges::find_if(own->wishes, [now](const Wish& w) { return !w.parked && w.due <= now; });
    if (wish == own->wishes.end()) continue;
    Task task{own->scene.lock(), wish->mesh_id};
    if (task.scene == nullptr) continue;
    scenes_.splice(scenes_.end(), scenes_, own);
    return task;
  }
  return std::nullopt;
}

TreeBuilder::Clock::time_point TreeBuilder::next_due() const {
  Clock::time_point next = Clock::now() + std::chrono::hours(1);
  for (const SceneWishes& own : scenes_)
    for (const Wish& wish : own.wishes)
      if (!wish.parked) next = std::min(next, wish.due);
  return next;
}

void TreeBuilder::work(const std::stop_token& ending) {
  std::unique_lock lock(mutex_);
  while (!ending.stop_requested()) {
    std::optional<Task> task = take();
    if (!task) {
      const std::uint64_t seen = changes_;
      changed_.wait_until(lock, ending, next_due(), [&] { return changes_ != seen; });
      continue;
    }
    lock.unlock();
    const Clock::time_point start = Clock::now();
    const Outcome outcome = build(*task, ending);
    const double ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    lock.lock();
    settle(*task, outcome, ms);
    lock.unlock();
    task.reset();  // perhaps the last to hold the scene
    lock.lock();
  }
}

TreeBuilder::Outcome TreeBuilder::build(const Task& task, const std::stop_token& ending) const {
  const auto order = scene::better_tree(*task.scene->snapshot(), task.mesh_id);
  if (!order) return Outcome::kNotWanted;
  std::stop_source stop;
  const std::stop_callback with_server(ending, [&stop] { stop.request_stop(); });
  const std::stop_callback with_scene(task.scene->gone(), [&stop] { stop.request_stop(); });
  const auto build_and_replace = [&]() -> Outcome {
    auto tree = blas::Blas::build(order->mesh, order->options, stop.get_token());
    // Most of the catching up while nobody waits.
    if (tree) tree = caught_up(*tree, *task.scene->snapshot(), task.mesh_id);
    if (stop.stop_requested()) return Outcome::kCancelled;
    if (!tree) return Outcome::kFailed;
    const auto refused = task.scene->replace_tree(task.mesh_id, *tree, stop.get_token());
    if (!refused)
      return refused.error().code == ErrorCode::kCancelled ? Outcome::kCancelled : Outcome::kFailed;
    if (!*refused) return Outcome::kReplaced;
    const bool moved = task.scene->snapshot()->blas(task.mesh_id).mesh_ptr() != order->mesh;
    return moved ? Outcome::kOutdated : Outcome::kNotBetter;
  };
  tbb::task_arena arena(build_threads_, 1, tbb::task_arena::priority::low);
  return arena.execute(build_and_replace);
}

void TreeBuilder::settle(const Task& task, Outcome outcome, double ms) {
  counts_.ms += ms;
  counts_.replaced += outcome == Outcome::kReplaced ? 1 : 0;
  counts_.dropped += outcome == Outcome::kOutdated || outcome == Outcome::kNotBetter ? 1 : 0;
  counts_.cancelled += outcome == Outcome::kCancelled ? 1 : 0;
  counts_.failed += outcome == Outcome::kFailed ? 1 : 0;
  const bool over = outcome == Outcome::kNotWanted || outcome == Outcome::kCancelled ||
                    !better_tree(*task.scene->snapshot(), task.mesh_id);
  if (over) return forget(*task.scene, task.mesh_id);
  Wish* wish = find(*task.scene, task.mesh_id);
  if (wish == nullptr) return;
  // At most half of the time is spent on a mesh that goes on moving, less where it was in vain.
  wish->drops = outcome == Outcome::kReplaced ? 0 : std::min(wish->drops + 1, kMostDoublings);
  const std::chrono::duration<double, std::milli> pause(ms * double(1U << wish->drops));
  wish->due = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::min(pause, kLongestWait));
  wish->parked = outcome == Outcome::kNotBetter;
}

}  // namespace gridcast::server
