#pragma once
// The bottom level: one tree per mesh, a closed set of structures behind one interface.

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <variant>

#include "core/blas/ray_packet.h"
#include "core/error.h"
#include "core/math/hit.h"
#include "core/mesh/object_ray.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast {
class RayWay;
}
namespace gridcast::mesh {
struct ExactBest;
}

namespace gridcast::blas {

class BruteForce;
class Bvh;
class WideBvh;
class CompactBvh;
class KdTree;
class EmbreeTree;
class HitSink;
class PointSink;

/// kAuto picks by a stated cost model: brute force for a handful of triangles, else the wide BVH, or a
/// kd-tree where boxes overlap so much that it costs less. kBvh is the binary one: half the memory, a third
/// of the speed, and a choice of splits. kCompactBvh is the wide one in a third of its memory, for scenes
/// that would not fit: kAuto never takes it.
enum class StructureKind : std::uint8_t { kAuto, kBruteForce, kBvh, kWideBvh, kKdTree, kEmbree, kCompactBvh };
enum class BvhSplit : std::uint8_t { kMidpoint, kMedian, kBinnedSah };
/// kAuto: a triangle may sit in several leaves where boxes overlap so much that it pays. kNever: for meshes
/// that deform, because a refit gives every leaf the whole triangle's box.
enum class SpatialSplits : std::uint8_t { kAuto, kNever };

/// kDefault: the best rays, by surface-area cost from the top. kFast: a wide tree in a fifth of the
/// time, in Morton order, at some 20 % more cost, for meshes that change whole from frame to frame.
/// Of all BVHs of ours; other structures have one way.
enum class BuildQuality : std::uint8_t { kDefault, kFast };

/// Names used on the wire and the command line: auto, brute_force, bvh, wide_bvh, compact_bvh, kd_tree,
/// embree.
[[nodiscard]] std::string_view to_string(StructureKind kind);
[[nodiscard]] Result<StructureKind> parse_structure_kind(std::string_view name);
/// midpoint, median, sah.
[[nodiscard]] std::string_view to_string(BvhSplit split);
[[nodiscard]] Result<BvhSplit> parse_bvh_split(std::string_view name);
/// auto, never.
[[nodiscard]] std::string_view to_string(SpatialSplits spatial);
[[nodiscard]] Result<SpatialSplits> parse_spatial_splits(std::string_view name);
/// default, fast.
[[nodiscard]] std::string_view to_string(BuildQuality quality);
[[nodiscard]] Result<BuildQuality> parse_build_quality(std::string_view name);

/// Whether the vertices are going to move: kAuto never takes a kd-tree then, which cannot be refitted.
enum class MeshMotion : std::uint8_t { kStatic, kDeforms };

struct BuildOptions {
  StructureKind kind = StructureKind::kAuto;
  BvhSplit split = BvhSplit::kBinnedSah;         ///< used by the BVH alone
  SpatialSplits spatial = SpatialSplits::kAuto;  ///< used by the wide and the compact BVH
  MeshMotion motion = MeshMotion::kStatic;
  BuildQuality quality = BuildQuality::kDefault;  ///< kFast: no other choice of splits counts, no kd-tree
};

/// What a structure is made of, for `info` and `structure`.
struct StructureStats {
  StructureKind kind = StructureKind::kBruteForce;  ///< never kAuto
  std::string reason;                               ///< why this kind was chosen, as a sentence
  std::size_t triangle_count = 0;
  std::size_t node_count = 0;
  std::size_t leaf_count = 0;
  std::size_t reference_count = 0;  ///< triangles counted once per leaf that holds them
  std::size_t max_depth = 0;
  std::size_t memory_bytes = 0;  ///< of the structure, without the mesh
  double cost = 0.0;  ///< surface-area cost now, in triangle tests per random ray that meets the root box
  double cost_at_build = 0.0;  ///< the same when it was last built
  double looseness = 0.0;  ///< the same by the boxes of the triangles instead of the root's; 0 = not known
  double looseness_at_build = 0.0;
  double build_ms = 0.0;
  std::uint32_t refits_since_build = 0;
};

/// What came of a repair. kUnneeded: nothing is worse enough than when it was built to pay for it; the tree
/// is the same. kRebuild: so much is worse, or the top of the tree, that only a whole build helps; the tree
/// is the same.
enum class RepairOutcome : std::uint8_t { kUnneeded, kRepaired, kRebuild };
struct Repair;

/// A mesh and its structure, immutable and shared by every instance of the mesh. Copies are cheap.
class Blas {
 public:
  /// `mesh` is valid (mesh::validate). Builds in parallel on the calling arena.
  /// kUnsupported when the kind is not compiled in or a library refuses; kCancelled on `stop`.
  [[nodiscard]] static Result<Blas> build(std::shared_ptr<const mesh::TriangleMesh> mesh,
                                          const BuildOptions& options, std::stop_token stop = {});

  /// The same structure over moved vertices: same topology_version and triangle count as the mesh it was
  /// built from. kUnsupported when this kind cannot refit (kd-tree): build instead.
  [[nodiscard]] Result<Blas> refit(std::shared_ptr<const mesh::TriangleMesh> moved) const;
  /// The same, bit for bit, when `moved` differs from mesh() in these vertices only: faster for a few.
  /// kInvalidArgument with `/vertices/K` when one is not of the mesh; any order, repeats allowed.
  [[nodiscard]] Result<Blas> refit(std::shared_ptr<const mesh::TriangleMesh> moved,
                                   std::span<const std::uint32_t> vertices) const;
  [[nodiscard]] bool can_refit() const;

  /// Builds the subtrees of a refitted tree anew that have become worse than they were when built, while the
  /// others are fine: time for the triangles in those and a copy of the tree. Same mesh, same answers.
  /// `cost_at_build` becomes what the tree would cost if every part was as good as when it was built.
  /// kUnsupported unless this is a wide BVH in which no leaves share a triangle; kCancelled on `stop`;
  /// kLimitExceeded without the memory.
  [[nodiscard]] Result<Repair> repair(const std::stop_token& stop = {}) const;

  [[nodiscard]] const mesh::TriangleMesh& mesh() const { return *mesh_; }
  [[nodiscard]] const std::shared_ptr<const mesh::TriangleMesh>& mesh_ptr() const { return mesh_; }
  /// The corners of a hit that intersect() or intersect_packet() of this Blas found: those of its triangle in
  /// mesh(), from where they are nearest.
  [[nodiscard]] std::array<Vec3f, 3> corners(const Hit& hit) const;
  /// Asks for the memory that corners() will read.
  void prefetch_corners(const Hit& hit) const;
  [[nodiscard]] const Bounds3f& bounds() const { return bounds_; }
  [[nodiscard]] const StructureStats& stats() const { return stats_; }
  [[nodiscard]] const BuildOptions& options() const { return options_; }
  /// What stats().cost estimates, counted: see blas::steps_per_ray. Nothing where no steps are counted, in
  /// structures other than a wide BVH; kCancelled on `stop`. Time for the rays: long where the tree is bad.
  [[nodiscard]] Result<std::optional<double>> steps_per_ray(std::size_t rays,
                                                            const std::stop_token& stop = {}) const;

  /// Closest hit: replaces `best` when a triangle is closer by the tie rule (best.t starts as tfar).
  /// `ray` was prepared with bounds(). True when `best` was replaced.
  template <Precision kPrecision>
  bool intersect(const mesh::ObjectRay& ray, Hit& best) const;

  /// Any hit with t in [ray.tnear, tfar].
  template <Precision kPrecision>
  [[nodiscard]] bool occluded(const mesh::ObjectRay& ray, double tfar) const;

  /// intersect() of `exact`: `ray` was prepared by mesh::ExactRay.
  bool intersect_exact(const mesh::ObjectRay& ray, mesh::ExactBest& best) const;
  /// occluded() of `exact`.
  [[nodiscard]] bool occluded_exact(const mesh::ObjectRay& ray, double tfar) const;

  /// Offers every hit in [ray.tnear, sink.tfar()] to the sink, as a Collector is offered hits: at least once,
  /// in any order. `ray` was prepared with bounds().
  template <Precision kPrecision>
  void intersect_every(const mesh::ObjectRay& ray, HitSink& sink) const;

  /// What intersect() does, or for kExact intersect_exact(), told to `way`; `best` is a Hit or an ExactBest.
  /// The same nodes in the same order, the same triangles tested, the same hit bit for bit
  /// (core/blas/explain.h).
  template <Precision kPrecision, class Best>
  void explain(const mesh::ObjectRay& ray, Best& best, RayWay& way) const;

  /// Offers the triangles around sink.center(), a point of object space: see PointSink.
  void search(PointSink& sink) const;
  /// Whether the mesh has an inside (mesh::has_inside). Found out when first asked, once for all copies.
  [[nodiscard]] bool has_inside() const;

  /// Whether this structure traces packets at all.
  [[nodiscard]] bool has_packets() const;
  /// intersect() or occluded() for the rays of a packet, lane by lane the same answers; best[lane].t starts
  /// as tfar. Does nothing when the result says so.
  template <Precision kPrecision>
  PacketResult intersect_packet(const RayPacket& packet, Hit* best) const;
  template <Precision kPrecision>
  PacketResult occluded_packet(const RayPacket& packet) const;

  /// The wide BVH that this is, or null: another structure, or no triangle.
  [[nodiscard]] const WideBvh* wide_bvh() const;

  /// Checks every invariant of the structure against the mesh: boxes contain what is below them, every
  /// triangle is reachable, links are in range. The error says what and where.
  [[nodiscard]] Status validate() const;

 private:
  using Structure = std::variant<std::shared_ptr<const BruteForce>, std::shared_ptr<const Bvh>,
                                 std::shared_ptr<const WideBvh>, std::shared_ptr<const KdTree>,
                                 std::shared_ptr<const EmbreeTree>, std::shared_ptr<const CompactBvh>>;
  friend class TreeCodec;  // reads and makes one: tree_codec.cpp
  Blas() = default;
  /// The mesh, and what follows from it alone.
  void set_mesh(std::shared_ptr<const mesh::TriangleMesh> mesh);
  template <Precision kPrecision, class C>
  bool collect(const mesh::ObjectRay& ray, C& collector) const;
  template <class Refit>
  Result<Blas> refitted(std::shared_ptr<const mesh::TriangleMesh> moved, const Refit& refit) const;
  template <class C>
  bool collect_exact(const mesh::ObjectRay& ray, C& collector) const;
  void add_structure_stats();
  Status prefer_kd_tree(const std::stop_token& stop);

  std::shared_ptr<const mesh::TriangleMesh> mesh_;
  Structure structure_;
  struct Inside;
  std::shared_ptr<Inside> inside_;
  Bounds3f bounds_;
  BuildOptions options_;
  StructureStats stats_;
};

/// See Blas::repair.
struct Repair {
  Blas blas;
  RepairOutcome outcome = RepairOutcome::kUnneeded;
  std::size_t triangles = 0;  ///< built anew; of kRebuild those that should be
  std::size_t subtrees = 0;   ///< that hold them
  double cost_before = 0.0;
  double cost_after = 0.0;
  double ms = 0.0;
};

}  // namespace gridcast::blas
