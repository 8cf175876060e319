// Refitted trees answer as trees built anew do, whatever became of the vertices.

#include <cmath>
#include <cstring>
#include <functional>
#include <map>

#include <gtest/gtest.h>

#include "core/blas/bvh.h"
#include "core/blas/wide_bvh.h"
#include "core/measure/deformation_set.h"
#include "core/scene/update.h"
#include "tests/stability/subject.h"
#include "tests/stability/truth.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::stability {
namespace {

using blas::StructureKind;
using mesh::TriangleMesh;
using Positions = std::vector<Vec3f>;

constexpr std::uint64_t kShuffleSeed = 36;
constexpr StructureKind kRefittable[] = {StructureKind::kBvh, StructureKind::kWideBvh,
                                         StructureKind::kCompactBvh};

/// How far the vertices are `phase` of the way, from 0 to 1.
using Deformation = std::function<Positions(const Positions& rest, double phase)>;

/// `step(p, share)` for every vertex.
template <class Step>
Deformation by_vertex(const Step& step) {
  return [step](const Positions& rest, double phase) {
    Positions to;
    to.reserve(rest.size());
    for (const Vec3f& p : rest) to.push_back(step(p, float(phase)));
    return to;
  };
}

/// Those of the benchmark, and two that it has no use for.
const std::map<std::string, Deformation>& deformations() {
  static const std::map<std::string, Deformation> all = [] {
    std::map<std::string, Deformation> made;
    for (const measure::Deformation how : measure::kAllDeformations)
      made[std::string(measure::to_string(how))] = [how](const Positions& rest, double phase) {
        return measure::deformed(how, rest, phase, kShuffleSeed);
      };
    made["collapse to a point"] =
        by_vertex([](const Vec3f& p, float phase) { return (1.F - phase) * p + Vec3f(1.F, 2.F, 3.F); });
    made["mirror"] =
        by_vertex([](const Vec3f& p, float phase) { return Vec3f((1.F - 2.F * phase) * p.x, p.y, p.z); });
    return made;
  }();
  return all;
}

std::shared_ptr<const TriangleMesh> with_positions(const TriangleMesh& mesh, Positions positions,
                                                   std::uint32_t version) {
  TriangleMesh changed = mesh;
  changed.positions = std::move(positions);
  changed.vertex_version = version;
  return test::share(std::move(changed));
}

// Frame after frame, a tree is refitted, never built again: its answers are those of a tree built for the
// frame, and those of every triangle.
TEST(Stability, RC36_RefittedTreesAnswerLikeBuiltOnes) {
  Row row(36, 16000);
  constexpr std::size_t kFrames = 100;
  for (const auto& [name, deform] : deformations()) {
    const MeshSource source = generated("jittered_icosphere 2 36");
    const std::uint32_t corners = std::uint32_t(source.mesh->positions.size());
    std::map<StructureKind, blas::Blas> trees;
    for (const StructureKind kind : kRefittable)
      trees.emplace(kind, blas::Blas::build(source.mesh, {kind}).value());
    const std::size_t rays = row.rays(deformations().size() * kFrames);
    for (std::size_t frame = 1; frame <= kFrames; ++frame) {
      const double phase = double(frame) / double(kFrames);
      const auto mesh =
          with_positions(*source.mesh, deform(source.mesh->positions, phase), std::uint32_t(frame));
      ASSERT_EQ(mesh->positions.size(), corners);
      const auto reference = blas::Blas::build(mesh, {StructureKind::kBruteForce}).value();
      for (auto& [kind, tree] : trees) {
        tree = tree.refit(mesh).value();
        const Status valid = tree.validate();
        if (!valid.ok())
          row.fail(name + ": after a refit " + valid.error().where + ' ' + valid.error().message);
        const auto rebuilt = blas::Blas::build(mesh, {kind}).value();
        blas::RayMaker maker(*mesh, row.seed() + frame);
        for (std::size_t i = 0; i < rays; ++i) {
          const blas::RayCase ray = maker.any();
          const Hit got = blas::closest<Precision::kRobust>(tree, ray);
          for (const blas::Blas* other : {&rebuilt, &reference}) {
            const Hit want = blas::closest<Precision::kRobust>(*other, ray);
            const bool same = got.t == want.t && got.u == want.u && got.v == want.v &&
                              got.primitive_id == want.primitive_id;
            if (!same || blas::any<Precision::kRobust>(tree, ray) != want.valid())
              row.fail(placed(given(*mesh)), {ray.ray, {0, ray.excluded}, {}},
                       name + ": a refitted " + std::string(blas::to_string(kind)) + " answers otherwise");
          }
        }
        row.count(rays, 6 * rays);
      }
    }
  }
  // A frame that is not a number is refused whole, and the scene stays as it was.
  const auto scene = scene::build_scene(scene_data(placed(generated("jittered_icosphere 2 36")))).value();
  for (const float bad : {std::nanf(""), INFINITY, -INFINITY, 2e18F}) {
    Positions positions = scene->blas(0).mesh().positions;
    positions[17].y = bad;
    for (const auto mode :
         {scene::UpdateMode::kAuto, scene::UpdateMode::kRefit, scene::UpdateMode::kRebuild}) {
      const auto updated = scene::apply_update(*scene, {scene::ReplaceVertices{0, positions, {}, mode}});
      ASSERT_FALSE(updated.ok());
      EXPECT_EQ(updated.error().code, ErrorCode::kInvalidArgument);
      EXPECT_EQ(updated.error().where, "/edits/0/positions/17");
    }
  }
  EXPECT_TRUE(scene->validate().ok());
}

/// The boxes of two trees, bit by bit.
template <class Tree>
bool same_nodes(const Tree& a, const Tree& b) {
  return a->nodes().size() == b->nodes().size() &&
         std::memcmp(a->nodes().data(), b->nodes().data(), a->nodes().size() * sizeof(a->nodes()[0])) == 0;
}

/// Sound after every refit; twice the same is the same; back at the first frame the first bits are back.
template <class Tree>
void expect_idempotent(Row& row, const std::string& what, const Tree& built, const MeshSource& source,
                       const Deformation& deform) {
  const TriangleMesh& rest = *source.mesh;
  auto at_rest = built->refit(rest).value();
  auto tree = at_rest;
  for (int frame = 1; frame <= 10; ++frame) {
    const auto mesh = with_positions(rest, deform(rest.positions, 0.1 * frame), std::uint32_t(frame));
    tree = tree->refit(*mesh).value();
    if (!tree->validate(*mesh).ok()) row.fail(what + ": a vertex or a box lies outside of its box");
    if (!same_nodes(tree->refit(*mesh).value(), tree)) row.fail(what + ": a second refit changes bits");
    if (!same_nodes(tree, at_rest->refit(*mesh).value()))
      row.fail(what + ": a frame depends on those before it");
    row.count(1, 3);
  }
  if (!same_nodes(tree->refit(rest).value(), at_rest))
    row.fail(what + ": the first frame does not come back");
}

TEST(Stability, RC37_RefitIsConservativeAndIdempotent) {
  Row row(37, 320);
  for (const char* spec : {"jittered_icosphere 3 37", "slivers 400 37 1e3", "soup 4000 37 0.1"}) {
    const MeshSource source = generated(spec);
    for (const auto& [name, deform] : deformations()) {
      const std::string what = std::string(spec) + ", " + name;
      const auto binary = blas::Bvh::build(*source.mesh, {.split = blas::BvhSplit::kBinnedSah}, {}).value();
      // A tree that was never refitted has the same bits.
      if (!same_nodes(binary, binary->refit(*source.mesh).value()))
        row.fail(what + ": a refit of what was built changes bits");
      expect_idempotent(row, what + ", bvh", binary, source, deform);
      expect_idempotent(row, what + ", wide", blas::WideBvh::build(*source.mesh, {}, {}).value(), source,
                        deform);
    }
  }
}

}  // namespace
}  // namespace gridcast::stability
