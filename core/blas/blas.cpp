#include "core/blas/blas.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>
#include <new>
#include <utility>

#include "core/blas/brute_force.h"
#include "core/blas/bvh.h"
#include "core/blas/collector.h"
#include "core/blas/compact_bvh.h"
#include "core/blas/cost_model.h"
#include "core/blas/embree_tree.h"
#include "core/blas/kd_tree.h"
#include "core/blas/triangle_boxes.h"
#include "core/blas/wide_bvh.h"
#include "core/mesh/topology.h"

namespace gridcast::blas {
namespace {

template <class Pointer>
using Pointee = typename Pointer::element_type;

template <class T>
concept Refittable = requires(const T& structure, const mesh::TriangleMesh& moved) {
  structure.refit(moved);
};

struct Choice {
  StructureKind kind;
  std::string reason;
};

Choice choose(StructureKind asked, MeshMotion motion, std::size_t triangles) {
  if (asked == StructureKind::kKdTree && motion == MeshMotion::kDeforms) {
    return {StructureKind::kWideBvh,
            "a kd-tree was asked for, but the mesh deforms and a kd-tree cannot be refitted"};
  }
  if (asked != StructureKind::kAuto) return {asked, "asked for"};
  const std::string limit = std::to_string(kBruteForceTriangles);
  if (triangles <= kBruteForceTriangles) {
    return {StructureKind::kBruteForce, std::to_string(triangles) + " triangles: up to " + limit +
                                            " a tree saves nothing that pays for it"};
  }
  return {StructureKind::kWideBvh,
          std::to_string(triangles) + " triangles: more than the " + limit + " that need no tree"};
}

std::string rounded(double cost) {
  return std::to_string(std::llround(cost));
}

/// Moves a built structure into `slot`, or passes its error on.
template <class Slot, class T>
Status store(Slot& slot, Result<std::shared_ptr<const T>> built) {
  if (!built) return built.error();
  slot = *std::move(built);
  return ok_status();
}

/// Calls trace(tree, what it needs beside its ray) for a structure that traces packets; others say that they
/// do not.
template <class Structure, class Trace>
PacketResult trace_packet(const Structure& structure, const mesh::TriangleMesh& mesh, const Trace& trace) {
  if (const auto* wide = std::get_if<std::shared_ptr<const WideBvh>>(&structure)) return trace(**wide);
  if (const auto* compact = std::get_if<std::shared_ptr<const CompactBvh>>(&structure))
    return trace(**compact, mesh);
  return {};
}

Error out_of_memory() {
  return {ErrorCode::kLimitExceeded, "not enough memory for this structure", {}};
}

}  // namespace

/// What it costs a pass over the mesh to know.
struct Blas::Inside {
  std::once_flag looked;
  bool has_inside = false;
};

Result<Blas> Blas::build(std::shared_ptr<const mesh::TriangleMesh> mesh, const BuildOptions& options,
                         std::stop_token stop) try {
  const auto start = std::chrono::steady_clock::now();
  Choice choice = choose(options.kind, options.motion, mesh->triangle_count());
  Blas blas;
  Status status = ok_status();
  switch (choice.kind) {
    case StructureKind::kAuto:
    case StructureKind::kBruteForce:
      status = store(blas.structure_, BruteForce::build(*mesh, stop));
      break;
    case StructureKind::kBvh:
      status = store(blas.structure_, Bvh::build(*mesh, options, stop));
      break;
    case StructureKind::kWideBvh:
      status = store(blas.structure_, WideBvh::build(*mesh, options, stop));
      break;
    case StructureKind::kCompactBvh:
      status = store(blas.structure_, CompactBvh::build(*mesh, options, stop));
      break;
    case StructureKind::kKdTree:
      status = store(blas.structure_, KdTree::build(*mesh, stop));
      break;
    case StructureKind::kEmbree:
      status = store(blas.structure_, EmbreeTree::build(*mesh, stop));
      break;
  }
  if (!status) return status.error();

  blas.set_mesh(std::move(mesh));
  blas.options_ = options;
  blas.stats_.kind = choice.kind;
  blas.stats_.reason = std::move(choice.reason);
  blas.add_structure_stats();
  if (options.kind == StructureKind::kAuto && choice.kind == StructureKind::kWideBvh &&
      options.quality == BuildQuality::kDefault)
    status = blas.prefer_kd_tree(stop);
  if (!status) return status.error();
  blas.stats_.cost_at_build = blas.stats_.cost;
  blas.stats_.looseness_at_build = blas.stats_.looseness;
  blas.stats_.build_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return blas;
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

void Blas::set_mesh(std::shared_ptr<const mesh::TriangleMesh> mesh) {
  mesh_ = std::move(mesh);
  inside_ = std::make_shared<Inside>();
  // Where every box was just drawn there is no need to look at every vertex again.
  const WideBvh* wide = wide_bvh();
  bounds_ = wide != nullptr && wide->has_whole_triangles() ? wide->root_bounds() : mesh_->bounds();
  stats_.triangle_count = mesh_->triangle_count();
}

Result<Blas> Blas::refit(std::shared_ptr<const mesh::TriangleMesh> moved) const {
  return refitted(std::move(moved),
                  [](const auto& structure, const auto& mesh) { return structure.refit(mesh); });
}

Result<Blas> Blas::refit(std::shared_ptr<const mesh::TriangleMesh> moved,
                         std::span<const std::uint32_t> vertices) const {
  const auto outside =
      std::ranges::find_if(vertices, [&](std::uint32_t v) { return v >= mesh_->positions.size(); });
  if (outside != vertices.end()) {
    return Error{ErrorCode::kInvalidArgument,
                 "the mesh has only " + std::to_string(mesh_->positions.size()) + " vertices",
                 "/vertices/" + std::to_string(outside - vertices.begin())};
  }
  return refitted(std::move(moved), [vertices](const auto& structure, const auto& mesh) {
    if constexpr (requires { structure.refit(mesh, vertices); })
      return structure.refit(mesh, vertices);
    else
      return structure.refit(mesh);
  });
}

template <class Refit>
Result<Blas> Blas::refitted(std::shared_ptr<const mesh::TriangleMesh> moved, const Refit& refit) const try {
  if (moved->triangle_count() != mesh_->triangle_count()) {
    return Error{ErrorCode::kInvalidArgument,
                 "a refit keeps the triangles: built over " + std::to_string(mesh_->triangle_count()) +
                     ", given " + std::to_string(moved->triangle_count()),
                 "/triangles"};
  }
  if (moved->topology_version != mesh_->topology_version) {
    return Error{ErrorCode::kInvalidArgument,
                 "a refit keeps the topology: built over version " + std::to_string(mesh_->topology_version) +
                     ", given " + std::to_string(moved->topology_version),
                 "/topology_version"};
  }
  Blas blas;
  const Status status = std::visit(
      [&](const auto& structure) -> Status {
        if constexpr (Refittable<Pointee<std::decay_t<decltype(structure)>>>)
          return store(blas.structure_, refit(*structure, *moved));
        else
          return Error{ErrorCode::kUnsupported,
                       "a " + std::string(to_string(stats_.kind)) + " cannot be refitted; rebuild it",
                       {}};
      },
      structure_);
  if (!status) return status.error();

  blas.mesh_ = std::move(moved);
  blas.inside_ = std::make_shared<Inside>();
  // Every box was just drawn: no need to look at every vertex again.
  const auto* wide = std::get_if<std::shared_ptr<const WideBvh>>(&blas.structure_);
  blas.bounds_ = wide != nullptr ? (*wide)->root_bounds() : blas.mesh_->bounds();
  blas.options_ = options_;
  blas.stats_ = stats_;
  ++blas.stats_.refits_since_build;
  blas.add_structure_stats();
  return blas;
} catch (const std::bad_alloc&) {
  return out_of_memory();
}

bool Blas::can_refit() const {
  return std::visit(
      [](const auto& structure) { return Refittable<Pointee<std::decay_t<decltype(structure)>>>; },
      structure_);
}

template <Precision kPrecision, class C>
bool Blas::collect(const mesh::ObjectRay& ray, C& collector) const {
  return std::visit(
      [&](const auto& structure) {
        return structure->template intersect<kPrecision>(*mesh_, ray, collector);
      },
      structure_);
}

template <Precision kPrecision>
bool Blas::intersect(const mesh::ObjectRay& ray, Hit& best) const {
  ClosestHit closest{best};
  return collect<kPrecision>(ray, closest);
}

template <Precision kPrecision>
bool Blas::occluded(const mesh::ObjectRay& ray, double tfar) const {
  AnyHit any{tfar};
  return collect<kPrecision>(ray, any);
}

template <class C>
bool Blas::collect_exact(const mesh::ObjectRay& ray, C& collector) const {
  if (ray.exact->is_close) return collect<Precision::kExact>(ray, collector);
  return BruteForce().intersect<Precision::kExact>(*mesh_, ray, collector);
}

bool Blas::intersect_exact(const mesh::ObjectRay& ray, mesh::ExactBest& best) const {
  ExactClosest closest{best};
  return collect_exact(ray, closest);
}

bool Blas::occluded_exact(const mesh::ObjectRay& ray, double tfar) const {
  ExactAny any{tfar};
  return collect_exact(ray, any);
}

template <Precision kPrecision>
void Blas::intersect_every(const mesh::ObjectRay& ray, HitSink& sink) const {
  collect<kPrecision>(ray, sink);
}

template bool Blas::intersect<Precision::kFast>(const mesh::ObjectRay&, Hit&) const;
template bool Blas::intersect<Precision::kRobust>(const mesh::ObjectRay&, Hit&) const;
template bool Blas::occluded<Precision::kFast>(const mesh::ObjectRay&, double) const;
template bool Blas::occluded<Precision::kRobust>(const mesh::ObjectRay&, double) const;
template void Blas::intersect_every<Precision::kFast>(const mesh::ObjectRay&, HitSink&) const;
template void Blas::intersect_every<Precision::kRobust>(const mesh::ObjectRay&, HitSink&) const;

void Blas::search(PointSink& sink) const {
  std::visit([&](const auto& structure) { structure->search(*mesh_, sink); }, structure_);
}

bool Blas::has_inside() const {
  std::call_once(inside_->looked, [this] { inside_->has_inside = mesh::has_inside(*mesh_); });
  return inside_->has_inside;
}

std::array<Vec3f, 3> Blas::corners(const Hit& hit) const {
  const auto* wide = std::get_if<std::shared_ptr<const WideBvh>>(&structure_);
  if (wide == nullptr || hit.corners_at == kInvalidId) return mesh_->corners(hit.primitive_id);
  const TriangleBlock& block = (*wide)->blocks()[hit.corners_at / 4];
  const std::size_t lane = hit.corners_at % 4;
  return {block.corner(0, lane), block.corner(1, lane), block.corner(2, lane)};
}

void Blas::prefetch_corners(const Hit& hit) const {
  const auto* wide = std::get_if<std::shared_ptr<const WideBvh>>(&structure_);
  if (wide == nullptr || hit.corners_at == kInvalidId) {
    __builtin_prefetch(&mesh_->triangles[hit.primitive_id]);
    return;
  }
  const TriangleBlock& block = (*wide)->blocks()[hit.corners_at / 4];
  for (const auto& corner : block.corners) __builtin_prefetch(&corner);
}

const WideBvh* Blas::wide_bvh() const {
  const auto* wide = std::get_if<std::shared_ptr<const WideBvh>>(&structure_);
  return wide == nullptr || (*wide)->nodes().empty() ? nullptr : wide->get();
}

bool Blas::has_packets() const {
  return std::holds_alternative<std::shared_ptr<const WideBvh>>(structure_) ||
         std::holds_alternative<std::shared_ptr<const CompactBvh>>(structure_);
}

template <Precision kPrecision>
PacketResult Blas::intersect_packet(const RayPacket& packet, Hit* best) const {
  return trace_packet(structure_, *mesh_, [&](const auto& tree, const auto&... mesh) {
    if constexpr (kPrecision == Precision::kExact) {
      const auto& exact = static_cast<const ExactPacket&>(packet);
      return tree.template intersect_packet<kPrecision, false>(mesh..., bounds_, exact, exact.best);
    } else {
      return tree.template intersect_packet<kPrecision, false>(mesh..., bounds_, packet, best);
    }
  });
}

template <Precision kPrecision>
PacketResult Blas::occluded_packet(const RayPacket& packet) const {
  return trace_packet(structure_, *mesh_, [&](const auto& tree, const auto&... mesh) {
    const auto& of_precision = static_cast<const PacketOf<kPrecision>&>(packet);
    return tree.template intersect_packet<kPrecision, true>(mesh..., bounds_, of_precision, nullptr);
  });
}

PacketResult intersect_packet_exact(const Blas& blas, const ExactPacket& packet) {
  return blas.intersect_packet<Precision::kExact>(packet, nullptr);
}

PacketResult occluded_packet_exact(const Blas& blas, const ExactPacket& packet) {
  return blas.occluded_packet<Precision::kExact>(packet);
}

template PacketResult Blas::intersect_packet<Precision::kFast>(const RayPacket&, Hit*) const;
template PacketResult Blas::intersect_packet<Precision::kRobust>(const RayPacket&, Hit*) const;
template PacketResult Blas::occluded_packet<Precision::kFast>(const RayPacket&) const;
template PacketResult Blas::occluded_packet<Precision::kRobust>(const RayPacket&) const;

Status Blas::validate() const {
  return std::visit([&](const auto& structure) { return structure->validate(*mesh_); }, structure_);
}

/// Trades the wide BVH for a kd-tree where that costs less; looks only where boxes overlap much.
Status Blas::prefer_kd_tree(const std::stop_token& stop) {
  const double limit = kOverlapCost * std::cbrt(double(stats_.triangle_count));
  if (stats_.cost <= limit || stats_.triangle_count > kMaxKdTriangles) return ok_status();
  const std::string in_bvh = rounded(stats_.cost) + " tests in a wide BVH";
  if (options_.motion == MeshMotion::kDeforms) {
    stats_.reason = "boxes overlap, a random ray costs " + in_bvh +
                    ", but the mesh deforms and a kd-tree cannot be refitted";
    return ok_status();
  }
  auto kd_tree = KdTree::build(*mesh_, stop);
  if (!kd_tree) return stop.stop_requested() ? Status(kd_tree.error()) : ok_status();
  StructureStats stats;
  (*kd_tree)->add_stats(stats);
  stats_.reason =
      "boxes overlap: a random ray costs " + in_bvh + ", " + rounded(stats.cost) + " in a kd-tree";
  if (stats.cost >= stats_.cost) return ok_status();
  structure_ = *std::move(kd_tree);
  stats_.kind = StructureKind::kKdTree;
  add_structure_stats();
  return ok_status();
}

void Blas::add_structure_stats() {
  std::visit([&](const auto& structure) { structure->add_stats(stats_); }, structure_);
  if (stats_.kind == StructureKind::kBruteForce) return;  // cannot become worse
  const double boxes = triangle_boxes_per_ray(*mesh_, bounds_);
  stats_.looseness = boxes > 0.0 ? stats_.cost / boxes : 0.0;
}

}  // namespace gridcast::blas
