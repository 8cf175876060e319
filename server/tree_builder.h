#pragma once
// Builds better trees while the present ones serve.

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>
#include <vector>

namespace gridcast::server {

class NamedScene;

struct TreeBuildCounts {
  std::size_t waiting = 0;      ///< now, the one at work included
  std::uint64_t replaced = 0;   ///< trees that came into use
  std::uint64_t dropped = 0;    ///< that were no better than what was there when they were ready
  std::uint64_t cancelled = 0;  ///< with their scene or the server
  std::uint64_t failed = 0;     ///< for want of memory
  double ms = 0.0;              ///< at work, in all
};

/// One tree at a time, scene after scene, on a few threads of low priority. What is dropped because the mesh
/// had moved on is tried again later and later, so that a mesh that changes whole from frame to frame costs
/// little, and gets its tree when it comes to rest.
class TreeBuilder {
 public:
  /// `threads` of the whole server: a quarter of them build.
  explicit TreeBuilder(std::size_t threads);
  /// Cancels and waits.
  ~TreeBuilder();
  TreeBuilder(const TreeBuilder&) = delete;
  TreeBuilder& operator=(const TreeBuilder&) = delete;

  /// The tree of this mesh could be better (scene::better_tree). Asked twice, it is built once.
  void want(const std::shared_ptr<NamedScene>& scene, std::uint32_t mesh_id);
  /// Cancels all and takes no more. Does not wait.
  void shut_down();

  [[nodiscard]] TreeBuildCounts counts() const;

 private:
  using Clock = std::chrono::steady_clock;

  struct Wish {
    std::uint32_t mesh_id = 0;
    unsigned drops = 0;       ///< of its trees, since the last that was of use
    Clock::time_point due{};  ///< not before
    bool parked = false;      ///< nothing better can be built until an update asks again
  };
  struct SceneWishes {
    std::weak_ptr<NamedScene> scene;
    std::vector<Wish> wishes;
  };
  struct Task {
    std::shared_ptr<NamedScene> scene;
    std::uint32_t mesh_id = 0;
  };
  enum class Outcome : std::uint8_t { kReplaced, kNotWanted, kOutdated, kNotBetter, kCancelled, kFailed };

  void work(const std::stop_token& ending);
  /// Under mutex_.
  [[nodiscard]] std::optional<Task> take();
  [[nodiscard]] Clock::time_point next_due() const;
  void settle(const Task& task, Outcome outcome, double ms);
  Wish* find(const NamedScene& scene, std::uint32_t mesh_id);
  void forget(const NamedScene& scene, std::uint32_t mesh_id);

  /// Without it.
  [[nodiscard]] Outcome build(const Task& task, const std::stop_token& ending) const;

  const int build_threads_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::list<SceneWishes> scenes_;  ///< whose turn comes first is first
  std::uint64_t changes_ = 0;      ///< of the wishes
  TreeBuildCounts counts_;
  std::jthread thread_;  // last: uses the rest
};

}  // namespace gridcast::server
