#pragma once
// One scene in every structure, asked through every door: {structures} x {closest, any} x {precisions} x {one
// thread ray by ray, all threads as a batch}.

#include <array>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/scene/scene.h"
#include "core/scene/trace.h"
#include "tests/stability/row.h"
#include "tests/stability/scene_spec.h"

namespace gridcast::stability {

/// Everything that promises something; a new mode is one more entry.
inline constexpr std::array kPrecisions{Precision::kFast, Precision::kRobust, Precision::kExact};
/// Those that promise which hits there are.
inline constexpr std::array kPromising{Precision::kRobust, Precision::kExact};
[[nodiscard]] std::string_view to_string(Precision precision);

/// The closest hits of the binary BVH, ray by ray: what all others were compared with.
struct Answers {
  std::vector<SurfaceHit> fast, robust, exact;
  [[nodiscard]] std::vector<SurfaceHit>& of(Precision precision) {
    return precision == Precision::kFast ? fast : precision == Precision::kExact ? exact : robust;
  }
};

class Subject {
 public:
  /// Builds all structures: binary BVH, brute force, wide BVH, compact BVH, kd-tree, Embree, and a grid that
  /// holds the instances among others that nothing hits. Structures of Embree are left out where it does not
  /// run.
  explicit Subject(SceneSpec spec);

  [[nodiscard]] const SceneSpec& spec() const { return spec_; }
  /// In the binary BVH.
  [[nodiscard]] const scene::Scene& scene() const { return *structures_.front().scene; }

  /// Asks all structures all rays. To `row` it reports every answer that differs by a bit from the binary
  /// BVH's, whatever is not a number, and every promised answer that is not what the shot expects. Brute
  /// force gets as many of the first rays as it can afford; in exact mode the other structures get a quarter
  /// of them.
  Answers ask(Row& row, std::span<const Shot> shots,
              std::span<const Precision> precisions = kPrecisions) const;

  /// For many rays: ask() for the first kAskedRays, then each block is asked of one structure through one of
  /// the batch doors, in turn, and only what the shots expect is checked.
  void shoot(Row& row, std::span<const Shot> shots);
  static constexpr std::size_t kAskedRays = 4096;
  /// The scene in one structure after the other, brute force left out.
  [[nodiscard]] const scene::Scene& next_structure();

 private:
  struct Structure {
    std::string name;
    std::shared_ptr<const scene::Scene> scene;
    bool brute_force = false;
  };
  class Asking;
  /// How many rays of a block the structure is asked.
  [[nodiscard]] std::size_t affordable(const Structure& structure, std::size_t count,
                                       Precision precision = Precision::kRobust) const;

  SceneSpec spec_;
  std::vector<Structure> structures_;
  std::uint64_t world_triangles_ = 0;
  std::size_t asked_ = 0;
  std::size_t turn_ = 0;
};

/// Equal to the last bit, the sign of zeros included.
[[nodiscard]] bool same_bits(const SurfaceHit& a, const SurfaceHit& b);
/// The answer in words, for messages.
[[nodiscard]] std::string describe(const SurfaceHit& hit);

}  // namespace gridcast::stability
