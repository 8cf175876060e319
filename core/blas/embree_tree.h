#pragma once
// Embree as an alternative tree: it finds candidates, our triangle test decides, so hits are ours bit for
// bit.

#include <memory>
#include <stop_token>

#include "core/blas/blas.h"
#include "core/blas/collector.h"
#include "core/blas/point_sink.h"

struct RTCSceneTy;

namespace gridcast::blas {

/// What a new device of Embree is told so that it keeps to the set of instructions that our kernels are
/// limited to (core/math/instruction_set.h); null where there is no limit.
[[nodiscard]] const char* embree_device_config();

/// rtcCommitScene, as a task of a context that is never destroyed. A scene of Embree holds a group of tasks,
/// whose context remembers that of the task by which the scene is first committed; with any cancellation,
/// whoever's, oneTBB goes from all contexts to those they remember. A build among others as tasks would leave
/// the scene with one that is gone.
void commit_embree_scene(RTCSceneTy* scene);

/// Embree's tree over user geometry with padded triangle boxes. Cannot be refitted: an Embree scene can be
/// neither copied nor changed while it is read, so moved vertices get a new one.
class EmbreeTree {
 public:
  /// kCancelled on `stop`; kUnsupported when Embree does not run on this processor; kLimitExceeded when it
  /// runs out of memory.
  [[nodiscard]] static Result<std::shared_ptr<const EmbreeTree>> build(const mesh::TriangleMesh& mesh,
                                                                       std::stop_token stop);
  EmbreeTree();
  ~EmbreeTree();
  EmbreeTree(const EmbreeTree&) = delete;
  EmbreeTree& operator=(const EmbreeTree&) = delete;

  /// True when an offer narrowed the range or ended the traversal.
  template <Precision kPrecision, Collector C>
  bool intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const;

  /// Offers the triangles around sink.center(); see PointSink.
  void search(const mesh::TriangleMesh& mesh, PointSink& sink) const;

  /// Embree's nodes cannot be seen from outside: checks the box of all, and for up to kMaxProbes triangles
  /// that a ray which starts on one is led to it.
  [[nodiscard]] Status validate(const mesh::TriangleMesh& mesh) const;
  /// Node counts, depth and cost stay 0: Embree does not tell them.
  void add_stats(StructureStats& stats) const;

  static constexpr std::size_t kMaxProbes = 4096;

 private:
  struct Scene;
  std::unique_ptr<Scene> scene_;
};

}  // namespace gridcast::blas
