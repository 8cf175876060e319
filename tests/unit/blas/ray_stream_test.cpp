// A stream gives what its rays give one by one, bit for bit, whatever trees they go through.

#include "core/blas/ray_stream.h"

#include <gtest/gtest.h>

#include "core/math/instruction_set.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

/// Rays that have nothing to do with each other, each with a tree of its own.
struct Stream {
  std::vector<const Blas*> trees;
  std::vector<RayCase> rays;
  std::vector<mesh::ObjectRay> prepared;

  void add(const Blas& tree, const RayCase& ray) {
    mesh::ObjectRay object_ray;
    if (!object_ray.prepare(ray.ray, tree.bounds())) return;
    object_ray.instance_id = std::uint32_t(rays.size());
    object_ray.excluded_primitive = ray.excluded;
    trees.push_back(&tree);
    rays.push_back(ray);
    prepared.push_back(object_ray);
  }
};

/// Returns how many rays hit something.
template <Precision kPrecision>
int expect_same_as_single_rays(const Stream& stream) {
  const std::size_t count = stream.rays.size();
  std::vector<Hit> best(count), expected(count);
  std::vector<StreamRay<kPrecision>> rays;
  for (std::size_t i = 0; i < count; ++i) {
    best[i].t = expected[i].t = stream.rays[i].ray.tfar;
    rays.push_back({stream.trees[i], &stream.prepared[i], &best[i], stream.rays[i].ray.tfar});
  }
  const std::uint32_t closest = intersect_stream<kPrecision>(rays).hits;
  const std::uint32_t any = occluded_stream<kPrecision>(rays).hits;
  EXPECT_EQ(closest >> count, 0U);
  int hits = 0;
  for (std::size_t i = 0; i < count; ++i) {
    SCOPED_TRACE(i);
    const bool hit = stream.trees[i]->intersect<kPrecision>(stream.prepared[i], expected[i]);
    hits += hit ? 1 : 0;
    EXPECT_EQ(best[i].t, expected[i].t);
    EXPECT_EQ(best[i].u, expected[i].u);
    EXPECT_EQ(best[i].v, expected[i].v);
    EXPECT_EQ(best[i].primitive_id, expected[i].primitive_id);
    EXPECT_EQ(best[i].instance_id, expected[i].instance_id);
    if (hit) {
      EXPECT_EQ(stream.trees[i]->corners(best[i]), stream.trees[i]->corners(expected[i]));
    }
    EXPECT_EQ((closest >> i & 1U) != 0, hit);
    EXPECT_EQ((any >> i & 1U) != 0, hit);
  }
  return hits;
}

/// Wide trees of every kind of mesh, and between them structures that a stream leaves to single rays.
std::vector<Blas> trees() {
  std::vector<Blas> all;
  for (const MeshCase& mesh_case : mesh_cases()) {
    auto wide = Blas::build(mesh_case.mesh, {StructureKind::kWideBvh});
    EXPECT_TRUE(wide.ok());
    if (wide) all.push_back(*std::move(wide));
  }
  for (const StructureKind kind : {StructureKind::kBvh, StructureKind::kKdTree, StructureKind::kCompactBvh}) {
    auto other = Blas::build(test::share(test::torus(24, 16)), {kind});
    EXPECT_TRUE(other.ok());
    if (other) all.push_back(*std::move(other));
  }
  return all;
}

int expect_same_on_streams(const std::vector<Blas>& trees, int streams, std::uint64_t seed) {
  std::vector<RayMaker> makers;
  for (const Blas& tree : trees) makers.emplace_back(tree.mesh(), seed + makers.size());
  Random random(seed);
  int hits = 0;
  for (int i = 0; i < streams && !::testing::Test::HasFailure(); ++i) {
    Stream stream;
    const std::uint32_t count = random.below(std::uint32_t(kStreamSize) + 1);
    for (std::uint32_t ray = 0; ray < count; ++ray) {
      const std::size_t tree = random.below(std::uint32_t(trees.size()));
      stream.add(trees[tree], makers[tree].any());
    }
    hits += expect_same_as_single_rays<Precision::kRobust>(stream);
    expect_same_as_single_rays<Precision::kFast>(stream);
  }
  return hits;
}

TEST(RayStream, every_ray_gets_the_answer_it_gets_alone) {
  EXPECT_GT(expect_same_on_streams(trees(), 4000, test::seed_or(81)), 10000);
}

TEST(RayStream, every_instruction_set_gives_the_same_answers) {
  const std::string before(instruction_set());
  const std::vector<Blas> all = trees();
  for (const std::string_view name : instruction_sets()) {
    SCOPED_TRACE(name);
    ASSERT_TRUE(limit_instruction_set(name));
    EXPECT_GT(expect_same_on_streams(all, 500, test::seed_or(82)), 1000);
  }
  ASSERT_TRUE(limit_instruction_set(before));
}

}  // namespace
}  // namespace gridcast::blas
