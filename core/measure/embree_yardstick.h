#pragma once
// Embree as it is used natively: what our figures are compared with. Nothing of ours is in its loops.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/math/affine.h"
#include "core/measure/ray_sets.h"
#include "core/scene/scene_data.h"

namespace gridcast::measure {

/// Embree's build qualities: Morton order, binned SAH, SAH with spatial splits.
enum class EmbreeQuality : std::uint8_t { kLow, kMedium, kHigh };
enum class EmbreeMode : std::uint8_t { kDefault, kRobust };
enum class EmbreeMemory : std::uint8_t { kDefault, kCompact };
/// kDynamic: vertices and transforms will change; Embree then builds what it can update.
enum class EmbreeUse : std::uint8_t { kStatic, kDynamic };
/// How rays are handed over.
enum class EmbreeEntry : std::uint8_t { kSingle, kPacket8, kPacket16, kPacket16Coherent };

[[nodiscard]] std::string_view to_string(EmbreeQuality quality);  ///< low, medium, high
[[nodiscard]] std::string_view to_string(EmbreeMode mode);        ///< default, robust
[[nodiscard]] std::string_view to_string(
    EmbreeEntry entry);  ///< single, packet8, packet16, packet16_coherent

struct EmbreeOptions {
  EmbreeQuality quality = EmbreeQuality::kMedium;
  EmbreeMode mode = EmbreeMode::kDefault;
  EmbreeMemory memory = EmbreeMemory::kDefault;
  EmbreeUse use = EmbreeUse::kStatic;
};

struct EmbreeInfo {
  std::string version;     ///< of the library in use
  std::string headers;     ///< of the headers we were compiled with
  std::string tasking;     ///< internal, tbb or ppl
  std::string assertions;  ///< whether the library was compiled with assertions: yes, no or unknown
  bool native_packet8 = false, native_packet16 = false;
};
[[nodiscard]] EmbreeInfo embree_info();

/// Row i belongs to ray i. An occlusion query writes `hit` alone.
struct EmbreeAnswers {
  std::vector<std::uint8_t> hit;
  std::vector<float> t;
  std::vector<float> uv;      ///< [N, 2]
  std::vector<float> normal;  ///< [N, 3], as Embree gives it: object space, not of unit length
  std::vector<std::uint32_t> instance_id, primitive_id;

  explicit EmbreeAnswers(std::size_t count)
      : hit(count), t(count), uv(2 * count), normal(3 * count), instance_id(count), primitive_id(count) {}
};

class EmbreeScene {
 public:
  /// Builds on the calling arena. `data` is only read meanwhile. Errors: kUnsupported when this Embree lacks
  /// what `options` ask for, or when the rest pose bends a mesh (scene::flattened has the bent ones),
  /// kCancelled.
  [[nodiscard]] static Result<std::unique_ptr<EmbreeScene>> build(const scene::SceneData& data,
                                                                  const EmbreeOptions& options,
                                                                  const std::stop_token& stop = {});
  EmbreeScene();
  ~EmbreeScene();
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;

  /// Rays [begin, end) of `rows`; packets are cut from neighbours. Any number of threads may trace.
  void trace(std::span<const std::array<float, 8>> rows, std::size_t begin, std::size_t end, QueryKind query,
             EmbreeEntry entry, EmbreeAnswers& answers) const;

  /// Moves the vertices of mesh 0 of a single-mesh kDynamic scene of kLow and refits its tree; the first call
  /// builds a tree that can be.
  [[nodiscard]] Status refit(std::span<const Vec3f> positions);
  /// Gives instances new places and commits the top level; `moves` of a kDynamic scene of instances.
  struct Move {
    std::uint32_t instance_id;
    Affine world_from_object;
  };
  [[nodiscard]] Status move_instances(std::span<const Move> moves);

  /// What Embree allocated: trees and its own tables, without the vertices and indices, which we lend it.
  [[nodiscard]] std::size_t memory_bytes() const;
  /// What it had allocated when the trees of the instanced meshes were done; 0 for a single mesh.
  [[nodiscard]] std::size_t mesh_memory_bytes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace gridcast::measure
