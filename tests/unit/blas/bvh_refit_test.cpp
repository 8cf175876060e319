#include <cmath>
#include <cstring>
#include <functional>
#include <numeric>

#include <gtest/gtest.h>

#include "core/blas/bvh.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

std::shared_ptr<const TriangleMesh> moved(const TriangleMesh& mesh, const std::function<Vec3f(Vec3f)>& move) {
  TriangleMesh result = mesh;
  for (Vec3f& p : result.positions) p = move(p);
  ++result.vertex_version;
  return test::share(std::move(result));
}

/// The positions of the mesh dealt out to other vertices.
std::shared_ptr<const TriangleMesh> shuffled(const TriangleMesh& mesh, std::uint64_t seed) {
  TriangleMesh result = mesh;
  Random random(seed);
  for (std::size_t i = result.positions.size(); i > 1; --i)
    std::swap(result.positions[i - 1], result.positions[random.below(std::uint32_t(i))]);
  return test::share(std::move(result));
}

struct Deformation {
  std::string name;
  std::function<Vec3f(Vec3f)> move;
};
std::vector<Deformation> deformations() {
  return {
      {"twist",
       [](Vec3f p) {
         const float a = 4.F * p.y;
         return Vec3f(std::cos(a) * p.x - std::sin(a) * p.z, p.y, std::sin(a) * p.x + std::cos(a) * p.z);
       }},
      {"explode", [](Vec3f p) { return 1e4F * glm::dot(p, p) * p; }},
      {"collapse to a plane", [](Vec3f p) { return Vec3f(p.x, 0.5F, p.z); }},
      {"collapse to a line", [](Vec3f p) { return Vec3f(0.25F, p.y, 0.5F); }},
      {"collapse to a point", [](Vec3f) { return Vec3f(1.F, 2.F, 3.F); }},
      {"mirror", [](Vec3f p) { return Vec3f(-p.x, p.y, p.z); }},
      {"offset", [](Vec3f p) { return p + Vec3f(1e6F, 0.F, -1e6F); }},
  };
}

void expect_same_answers(const Blas& a, const Blas& b, std::uint64_t seed) {
  RayMaker maker(a.mesh(), seed);
  for (int i = 0; i < 600; ++i) {
    const RayCase ray = maker.any();
    const Hit x = closest<Precision::kRobust>(a, ray);
    const Hit y = closest<Precision::kRobust>(b, ray);
    ASSERT_TRUE(x.t == y.t && x.u == y.u && x.v == y.v && x.primitive_id == y.primitive_id) << "ray " << i;
    ASSERT_EQ(any<Precision::kRobust>(a, ray), x.valid()) << "ray " << i;
  }
}

bool same_nodes(const Bvh& a, const Bvh& b) {
  return a.nodes().size() == b.nodes().size() &&
         std::memcmp(a.nodes().data(), b.nodes().data(), a.nodes().size() * sizeof(BvhNode)) == 0;
}

TEST(BvhRefit, moving_one_vertex_out_of_the_box_is_caught_and_then_healed) {
  const TriangleMesh mesh = test::jittered_icosphere(3, 1);
  const auto bvh = Bvh::build(mesh, {.split = BvhSplit::kBinnedSah}, {}).value();
  ASSERT_TRUE(bvh->validate(mesh).ok());

  TriangleMesh changed = mesh;
  changed.positions[77] *= 3.F;
  const Status caught = bvh->validate(changed);
  ASSERT_FALSE(caught.ok());
  EXPECT_EQ(caught.error().where.substr(0, 7), "/nodes/");

  const auto refitted = bvh->refit(changed).value();
  EXPECT_TRUE(refitted->validate(changed).ok());
  EXPECT_TRUE(bvh->validate(mesh).ok()) << "the old tree must stay as it was";
}

void expect_refits_answer_like_rebuilds(const TriangleMesh& mesh, StructureKind kind, std::uint64_t seed) {
  Blas blas = Blas::build(test::share(mesh), {kind}).value();
  auto frames = std::vector<std::shared_ptr<const TriangleMesh>>();
  for (const Deformation& deformation : deformations()) frames.push_back(moved(mesh, deformation.move));
  frames.push_back(shuffled(mesh, seed));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    SCOPED_TRACE(i < deformations().size() ? deformations()[i].name : "shuffle");
    blas = blas.refit(frames[i]).value();  // frame after frame, never from the start
    const Status status = blas.validate();
    ASSERT_TRUE(status.ok()) << status.error().where << status.error().message;
    expect_same_answers(blas, Blas::build(frames[i], {kind}).value(), seed);
    EXPECT_TRUE(std::isfinite(blas.stats().cost));
  }
}

TEST(BvhRefit, answers_are_those_of_a_rebuilt_tree_after_every_deformation) {
  const std::uint64_t seed = test::seed_or(41);
  for (const TriangleMesh& mesh : {test::torus(40, 20), test::needle_fan(400)}) {
    for (const StructureKind kind :
         {StructureKind::kBvh, StructureKind::kWideBvh, StructureKind::kCompactBvh}) {
      SCOPED_TRACE(to_string(kind));
      expect_refits_answer_like_rebuilds(mesh, kind, seed);
    }
  }
}

TEST(BvhRefit, returning_to_the_first_positions_gives_the_first_bits) {
  TriangleMesh mesh = test::soup(20000, test::seed_or(43));  // large enough for several tasks
  mesh.positions[0] = {-0.F, 0.F, -0.F};
  mesh.positions[1] = {0.F, -0.F, 0.F};
  for (const BvhSplit split : {BvhSplit::kMidpoint, BvhSplit::kMedian, BvhSplit::kBinnedSah}) {
    const auto built = Bvh::build(mesh, {.split = split}, {}).value();
    const auto away = built->refit(*shuffled(mesh, 5)).value();
    EXPECT_FALSE(same_nodes(*built, *away));
    const auto back = away->refit(mesh).value();
    EXPECT_TRUE(same_nodes(*built, *back));
    EXPECT_TRUE(same_nodes(*away, *back->refit(*shuffled(mesh, 5)).value()));
  }
}

TEST(BvhRefit, the_cost_follows_the_tree_and_the_cost_at_build_stays) {
  const auto start = test::share(test::icosphere(4));
  const Blas blas = Blas::build(start, {StructureKind::kBvh}).value();
  EXPECT_EQ(blas.stats().cost, blas.stats().cost_at_build);
  EXPECT_EQ(blas.stats().refits_since_build, 0U);

  const Blas worse = blas.refit(shuffled(*start, 3)).value();
  EXPECT_GT(worse.stats().cost, 1.5 * worse.stats().cost_at_build);
  EXPECT_EQ(worse.stats().cost_at_build, blas.stats().cost);
  EXPECT_EQ(worse.stats().refits_since_build, 1U);

  const Blas back = worse.refit(start).value();
  EXPECT_EQ(back.stats().cost, blas.stats().cost);
  EXPECT_EQ(back.stats().refits_since_build, 2U);
}

TEST(BvhRefit, an_empty_tree_and_a_single_leaf_can_be_refitted) {
  const TriangleMesh none;
  EXPECT_TRUE(Bvh::build(none, {.split = BvhSplit::kBinnedSah}, {})
                  .value()
                  ->refit(none)
                  .value()
                  ->validate(none)
                  .ok());
  const TriangleMesh one = test::single_triangle();
  const TriangleMesh far = test::translated(one, Vec3f(5.F));
  const auto bvh = Bvh::build(one, {.split = BvhSplit::kBinnedSah}, {}).value();
  EXPECT_FALSE(bvh->validate(far).ok());
  EXPECT_TRUE(bvh->refit(far).value()->validate(far).ok());
}

}  // namespace
}  // namespace gridcast::blas
