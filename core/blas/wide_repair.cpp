#include "core/blas/wide_repair.h"

#include <utility>

#include <oneapi/tbb/parallel_for.h>

#include "core/blas/bvh_builder.h"
#include "core/blas/refit_memory.h"
#include "core/blas/wide_cost.h"
#include "core/blas/wide_damage.h"
#include "core/blas/wide_layout.h"
#include "core/blas/wide_splice.h"

namespace gridcast::blas {
namespace {

/// In the order of the leaves, which every refit of a tree shares.
std::vector<std::uint32_t> triangles_in(const WideBvh& tree, const WideRange& range) {
  std::vector<std::uint32_t> ids;
  for (std::uint32_t i = range.begin; i < range.end; ++i) {
    const WideNode& node = tree.nodes()[i];
    for (std::uint32_t slot = 0; slot < node.slots; ++slot) {
      const std::uint32_t link = node.child[slot];
      if (!wide_child::is_leaf(link)) continue;
      for (std::uint32_t b = 0; b < wide_child::block_count(link); ++b) {
        const std::uint32_t* lanes = tree.blocks()[wide_child::index(link) + b].ids;
        for (int lane = 0; lane < 4; ++lane)
          if (lane == 0 || lanes[lane] != lanes[lane - 1]) ids.push_back(lanes[lane]);
      }
    }
  }
  return ids;
}

/// These triangles alone, each with vertices of its own.
mesh::TriangleMesh excerpt(const mesh::TriangleMesh& mesh, const std::vector<std::uint32_t>& ids) {
  mesh::TriangleMesh out;
  out.positions.reserve(3 * ids.size());
  out.triangles.reserve(ids.size());
  for (const std::uint32_t id : ids) {
    const auto first = std::uint32_t(out.positions.size());
    for (const Vec3f& corner : mesh.corners(id)) out.positions.push_back(corner);
    out.triangles.push_back({first, first + 1, first + 2});
  }
  return out;
}

Result<Graft> built_anew(const WideBvh& tree, const WideRange& range, const mesh::TriangleMesh& mesh,
                         const std::stop_token& stop) {
  const std::vector<std::uint32_t> ids = triangles_in(tree, range);
  Result<BvhTree> binary = build_bvh(excerpt(mesh, ids), {.block = LeafBlock::kFour}, stop);
  if (!binary) return binary.error();
  for (std::uint32_t& id : binary->primitive_ids) id = ids[id];
  Graft graft{range, {}, {}};
  lay_out(*binary, mesh, graft.nodes, graft.blocks);
  return graft;
}

Result<std::vector<Graft>> grafts_for(const WideBvh& tree, const std::vector<WideRange>& subtrees,
                                      const mesh::TriangleMesh& mesh, const std::stop_token& stop) {
  std::vector<Graft> grafts(subtrees.size());
  oneapi::tbb::parallel_for(std::size_t(0), grafts.size(), [&](std::size_t i) {
    if (auto graft = built_anew(tree, subtrees[i], mesh, stop)) grafts[i] = *std::move(graft);
  });
  // Within its limits a builder fails only when told to stop.
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the repair was cancelled", {}};
  return grafts;
}

/// What is known of the parts of a tree.
struct PartStates {
  std::vector<double> costs;
  std::vector<PartSize> own;
  std::vector<PartLooseness> looseness;
};

/// Those of a spliced tree: parts that stayed keep theirs, others are looked at.
PartStates spliced(const WideParts& old_parts, const PartStates& old, const Splice& splice,
                   const WideParts& parts, const WideNodes& nodes, const TriangleBlocks& blocks) {
  const std::size_t count = parts.all.size();
  PartStates states{std::vector<double>(count), std::vector<PartSize>(count), {}};
  constexpr std::size_t kNew = ~std::size_t(0);
  std::vector<std::size_t> before(count, kNew);
  oneapi::tbb::parallel_for(std::size_t(0), count, [&](std::size_t i) {
    const std::uint32_t node = splice.old_node(parts.all[i].begin);
    if (node != Splice::kGrafted) {
      const std::size_t part = old_parts.part_of(node);
      const WidePart& was = old_parts.all[part];
      if (was.begin == node && was.subtree == parts.all[i].subtree) before[i] = part;
    }
    const bool stayed = before[i] != kNew;
    states.costs[i] = stayed ? old.costs[before[i]] : part_cost(nodes, parts.all[i]);
    states.own[i] = stayed ? old.own[before[i]] : part_size(nodes, blocks, parts.all[i]);
  });
  states.looseness = part_looseness(states.costs, sizes_below(parts, states.own));
  for (std::size_t i = 0; i < count; ++i)
    if (before[i] != kNew) states.looseness[i] = old.looseness[before[i]];
  return states;
}

}  // namespace

Result<WideRepair> WideBvh::repair(const mesh::TriangleMesh& mesh, const std::stop_token& stop) const {
  WideRepair repair;
  if (nodes().empty()) return repair;
  if (shape_.reference_count != mesh.triangle_count())
    return Error{ErrorCode::kUnsupported, "several leaves share a triangle", {}};
  const RefitPlan& plan = memory_->plan(*this, mesh);
  PartStates states{storage_.part_costs, part_sizes(nodes(), blocks(), plan.parts), plan.looseness};
  const auto below = sizes_below(plan.parts, states.own);
  const Damage damage =
      find_damage(plan.parts, states.costs, fresh_costs(states.looseness, below, states.costs), below);
  repair.triangles = damage.triangles;
  repair.subtrees = damage.subtrees.size();
  if (damage.subtrees.empty()) return repair;
  repair.outcome = RepairOutcome::kRebuild;
  if (double(damage.triangles) > kMaxRepairShare * double(mesh.triangle_count())) return repair;

  const auto grafts = grafts_for(*this, damage.subtrees, mesh, stop);
  if (!grafts) return grafts.error();
  auto wide = std::make_shared<WideBvh>();
  RefitPlan next;
  const Splice splice(nodes(), *grafts);
  splice.write(*this, plan.corners, mesh, {wide->storage_.nodes, wide->storage_.blocks, next.corners});
  wide->shape_ = {.reference_count = shape_.reference_count, .spatial = shape_.spatial};
  wide->measure_shape();
  if (wide->shape_.max_depth > kMaxBvhDepth) return repair;
  next.parts = WideParts(wide->nodes());
  PartStates after = spliced(plan.parts, states, splice, next.parts, wide->nodes(), wide->blocks());
  const auto below_after = sizes_below(next.parts, after.own);
  repair.fresh_cost = tree_cost(wide->nodes(), fresh_costs(after.looseness, below_after, after.costs));
  wide->storage_.part_costs = std::move(after.costs);
  next.looseness = std::move(after.looseness);
  wide->memory_ = std::make_shared<RefitMemory>(std::move(next));
  repair.outcome = RepairOutcome::kRepaired;
  repair.tree = std::move(wide);
  return repair;
}

}  // namespace gridcast::blas
