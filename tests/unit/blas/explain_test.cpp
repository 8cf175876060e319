// What is told of a walk is what the kernel does: the same hit, the same offers in the same order, only boxes
// that the ray meets, children from near to far.

#include "core/blas/explain.h"

#include <map>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/math/instruction_set.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

using Offers = std::vector<std::pair<std::uint32_t, double>>;  // primitive_id and t

/// A triangle once where it comes several times running: a block that is not full repeats its last one, and
/// two leaves of a kd-tree may hold it.
void note(Offers& offers, std::uint32_t primitive_id, double t) {
  if (offers.empty() || offers.back().first != primitive_id) offers.emplace_back(primitive_id, t);
}

/// Narrows the range as ClosestHit does and remembers every offer. Goes through the kernel that lists every
/// hit, which is the one of closest hits but for its collector.
class OfferLog : public HitSink {
 public:
  explicit OfferLog(double tfar) : HitSink(tfar), best_{.t = tfar} {}

  Offer offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit, std::uint32_t primitive_id) override {
    note(offers_, primitive_id, hit.t);
    if (!mesh::keep_closer(ray, hit, primitive_id, best_)) return Offer::kGoOn;
    set_tfar(best_.t);
    return Offer::kNarrowed;
  }
  [[nodiscard]] const Offers& offers() const { return offers_; }

 private:
  Hit best_;
  Offers offers_;
};

RayWay unlimited(const RayCase& ray) {
  return {~std::size_t(0), ray.ray.tfar, {}};
}

/// Checks what a way says of its triangles against the hit that it led to; returns those that were offered.
Offers check_triangles(const RayWay& way, const RayCase& ray, const Hit& hit) {
  Offers offers;
  std::uint32_t best = kInvalidId;
  for (const WayStep& step : way.steps()) {
    const auto* triangle = std::get_if<TriangleStep>(&step);
    if (triangle == nullptr) continue;
    if (triangle->t) note(offers, triangle->primitive_id, *triangle->t);
    const TriangleVerdict verdict = triangle->verdict;
    EXPECT_EQ(triangle->t.has_value(),
              verdict != TriangleVerdict::kFiltered && verdict != TriangleVerdict::kMissed);
    if (triangle->t && triangle->primitive_id == ray.excluded) {
      EXPECT_EQ(verdict, TriangleVerdict::kExcluded);
    } else if (triangle->t) {
      const bool in_range = *triangle->t >= ray.ray.tnear && *triangle->t <= ray.ray.tfar;
      EXPECT_EQ(verdict, in_range ? TriangleVerdict::kHit : TriangleVerdict::kOutOfRange);
    }
    if (triangle->is_best) {
      EXPECT_EQ(verdict, TriangleVerdict::kHit);
      best = triangle->primitive_id;
    }
  }
  EXPECT_EQ(best, hit.primitive_id);
  return offers;
}

template <Precision kPrecision>
void expect_told_as_done(const Blas& blas, const RayCase& ray) {
  mesh::ObjectRay prepared;
  if (!prepared.prepare(ray.ray, blas.bounds())) return;
  prepared.excluded_primitive = ray.excluded;
  RayWay way = unlimited(ray);
  Hit told{.t = ray.ray.tfar};
  blas.explain<kPrecision>(prepared, told, way);
  const Hit done = closest<kPrecision>(blas, ray);
  ASSERT_EQ(told.primitive_id, done.primitive_id);
  ASSERT_EQ(told.t, done.t);
  ASSERT_EQ(told.u, done.u);
  ASSERT_EQ(told.v, done.v);
  ASSERT_FALSE(way.is_truncated());
  if (blas.stats().kind == StructureKind::kEmbree) {
    ASSERT_EQ(way.steps().size(), 1U);
    ASSERT_EQ(std::get<OpaqueStep>(way.steps()[0]).found_best, done.valid());
    return;
  }
  OfferLog log(ray.ray.tfar);
  blas.intersect_every<kPrecision>(prepared, log);
  ASSERT_EQ(check_triangles(way, ray, done), log.offers());
}

void expect_told_as_done(const Blas& blas, std::uint64_t seed, int rays) {
  RayMaker maker(blas.mesh(), seed);
  for (int i = 0; i < rays && !testing::Test::HasFailure(); ++i) {
    SCOPED_TRACE("ray " + std::to_string(i));
    const RayCase ray = maker.any();
    expect_told_as_done<Precision::kRobust>(blas, ray);
    expect_told_as_done<Precision::kFast>(blas, ray);
  }
}

class Explain : public testing::TestWithParam<StructureCase> {};

TEST_P(Explain, hits_and_offers_are_those_of_the_kernel) {
  const std::uint64_t seed = test::seed_or(91);
  for (const MeshCase& mesh_case : mesh_cases()) {
    SCOPED_TRACE(mesh_case.name);
    expect_told_as_done(Blas::build(mesh_case.mesh, GetParam().options).value(), seed, 300);
  }
}

INSTANTIATE_TEST_SUITE_P(Structures, Explain, testing::ValuesIn(structure_cases()),
                         [](const auto& structure) { return structure.param.name; });

TEST(ExplainKernels, every_instruction_set_is_told_as_it_decides) {
  const std::string before(instruction_set());
  const std::uint64_t seed = test::seed_or(92);
  for (const std::string_view set : instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(limit_instruction_set(set));
    for (const StructureKind kind :
         {StructureKind::kWideBvh, StructureKind::kCompactBvh, StructureKind::kKdTree})
      for (const auto& mesh : {test::share(test::quad_grid(16)), test::share(test::soup(600, 12, 0.2F))})
        expect_told_as_done(Blas::build(mesh, {kind}).value(), seed, 300);
  }
  ASSERT_TRUE(limit_instruction_set(before));
}

/// A node (false) or leaf (true) by its index, with its box and the node above it.
using Place = std::pair<bool, std::uint32_t>;
struct Part {
  Bounds3f box;
  std::uint32_t parent = 0;
};
using Parts = std::map<Place, Part>;

Parts parts_of(const Bvh& tree) {
  Parts parts;
  const BvhNodes& nodes = tree.nodes();
  parts[{nodes[0].leaf(), 0}] = {nodes[0].bounds()};
  for (std::uint32_t i = 0; i < nodes.size(); ++i) {
    if (i == 1 || nodes[i].leaf()) continue;
    for (const std::uint32_t child : {nodes[i].first, nodes[i].first + 1})
      parts[{nodes[child].leaf(), child}] = {nodes[child].bounds(), i};
  }
  return parts;
}

Parts parts_of(const WideBvh& tree) {
  Parts parts;
  parts[{false, 0}] = {tree.root_bounds()};
  for (std::uint32_t i = 0; i < tree.nodes().size(); ++i) {
    const WideNode& node = tree.nodes()[i];
    for (std::uint32_t slot = 0; slot < node.slots; ++slot)
      parts[{wide_child::is_leaf(node.child[slot]), wide_child::index(node.child[slot])}] = {node.box(slot),
                                                                                             i};
  }
  return parts;
}

Parts parts_of(const KdTree& tree) {
  Parts parts;
  parts[{false, 0}] = {tree.layout().bounds};
  for (std::uint32_t i = 0; i < tree.layout().treelets.size(); ++i) {
    const KdTreelet& treelet = tree.layout().treelets[i];
    const Bounds3f cell = parts.at({false, i}).box;  // parents come before children
    for (std::uint32_t slot = 0; slot < KdTreelet::kSlots; ++slot) {
      if (!treelet.is_used(slot)) continue;
      const bool inner = treelet.is_inner(slot);
      parts[{!inner, inner ? treelet.child(slot) : treelet.block(slot)}] = {treelet.child_cell(slot, cell),
                                                                            i};
    }
  }
  return parts;
}

/// Follows a way down a tree whose parts are known.
class WayChecker {
 public:
  WayChecker(const Parts& parts, const mesh::ObjectRay& ray, double tfar)
      : parts_(parts), ray_(ray), s_far_(ray.cull_far(tfar)) {}

  void visit(const Place& place, std::uint32_t depth, double t_enter) {
    const Part& part = parts_.at(place);
    EXPECT_TRUE(visited_.emplace(place, depth).second) << "visited twice";
    if (depth == 0) return;  // the root of a wide tree has no box: its kernel takes it as entered
    // The room is for the rounding of FMA instructions alone.
    const Vec3f room(0.25F * ray_.pad);
    float s_enter = 0.F;
    EXPECT_TRUE(mesh::intersect_box(ray_, part.box.lower - room, part.box.upper + room, s_far_, s_enter))
        << (place.first ? "leaf " : "node ") << place.second << " at depth " << depth;
    EXPECT_GE(t_enter, t_at(ray_, s_enter));
    const auto parent = visited_.find({false, part.parent});
    ASSERT_NE(parent, visited_.end()) << "visited before its parent";
    EXPECT_EQ(depth, parent->second + 1);
    const auto [last, first] = last_child_.emplace(part.parent, t_enter);
    EXPECT_TRUE(first || last->second <= t_enter) << "a nearer sibling comes later";
    last->second = t_enter;
  }

 private:
  const Parts& parts_;
  const mesh::ObjectRay& ray_;
  float s_far_;
  std::map<Place, std::uint32_t> visited_;  ///< depths
  std::map<std::uint32_t, double> last_child_;
};

template <class Tree>
void expect_sound_visits(const Tree& tree, const mesh::TriangleMesh& mesh, std::uint64_t seed) {
  const Parts parts = parts_of(tree);
  RayMaker maker(mesh, seed);
  std::size_t leaves = 0;
  for (int i = 0; i < 300 && !testing::Test::HasFailure(); ++i) {
    SCOPED_TRACE("ray " + std::to_string(i));
    const RayCase ray = maker.any();
    mesh::ObjectRay prepared;
    if (!prepared.prepare(ray.ray, mesh.bounds())) continue;
    prepared.excluded_primitive = ray.excluded;
    RayWay way = unlimited(ray);
    Hit best{.t = ray.ray.tfar};
    ClosestHit collector{best};
    explain<Precision::kRobust>(tree, mesh, prepared, collector, way);
    WayChecker checker(parts, prepared, ray.ray.tfar);
    std::int64_t waiting = 0;
    for (const WayStep& step : way.steps()) {
      if (const auto* node = std::get_if<NodeStep>(&step)) {
        checker.visit({false, node->node}, node->depth, node->t_enter);
        EXPECT_LE(node->children_hit, node->children);
        EXPECT_LE(std::int64_t(node->stack), waiting + std::max<std::int64_t>(0, node->children_hit - 1));
        waiting = node->stack;
      } else if (const auto* leaf = std::get_if<LeafStep>(&step)) {
        checker.visit({true, leaf->leaf}, leaf->depth, leaf->t_enter);
        EXPECT_LE(std::int64_t(leaf->stack), waiting);
        waiting = leaf->stack;
      }
    }
    leaves += way.counts().leaves;
  }
  EXPECT_GT(leaves, 300U) << "too few leaves to mean anything";
}

TEST(ExplainTrees, every_box_is_met_and_children_come_from_near_to_far) {
  const std::uint64_t seed = test::seed_or(93);
  for (const auto& mesh : {test::jittered_icosphere(4, 5), test::soup(900, 12, 0.2F), test::quad_grid(20)}) {
    expect_sound_visits(*Bvh::build(mesh, {}, {}).value(), mesh, seed);
    expect_sound_visits(*WideBvh::build(mesh, {}, {}).value(), mesh, seed);
    expect_sound_visits(*KdTree::build(mesh, {}).value(), mesh, seed);
  }
}

TEST(ExplainTrees, a_way_that_is_cut_ends_at_its_last_step) {
  const auto mesh = test::share(test::jittered_icosphere(3, 5));
  const Ray ray{{0.1, 0.2, 9}, {0, 0, -1}};
  for (const StructureKind kind : {StructureKind::kBruteForce, StructureKind::kBvh, StructureKind::kWideBvh,
                                   StructureKind::kCompactBvh, StructureKind::kKdTree}) {
    const Blas blas = Blas::build(mesh, {kind}).value();
    mesh::ObjectRay prepared;
    ASSERT_TRUE(prepared.prepare(ray, blas.bounds()));
    prepared.excluded_primitive = kInvalidId;
    const auto steps_of = [&](std::size_t max_steps) {
      RayWay way(max_steps, ray.tfar, {});
      Hit best;
      blas.explain<Precision::kRobust>(prepared, best, way);
      EXPECT_LE(way.steps().size(), max_steps);
      return std::pair(way.steps().size(), way.is_truncated());
    };
    const std::size_t whole = steps_of(~std::size_t(0)).first;
    EXPECT_EQ(steps_of(whole), std::pair(whole, false));
    for (std::size_t few = 1; few < whole; ++few) EXPECT_EQ(steps_of(few), std::pair(few, true));
  }
}

}  // namespace
}  // namespace gridcast::blas
