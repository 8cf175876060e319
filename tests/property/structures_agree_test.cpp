// On every mesh each structure gives the bits of brute force, in both precisions. More rays:
//   GRIDCAST_RAYS=1000000 build/release/bin/property --gtest_filter='StructuresAgree.*'

#include <bit>

#include <gtest/gtest.h>
#include <oneapi/tbb/parallel_for.h>

#include "tests/property/meshes.h"

namespace gridcast::property {
namespace {

using blas::Blas;
using blas::RayCase;

/// Compared with brute force, whose time grows with the mesh.
constexpr std::size_t kRaysAgainstBruteForce = 300;
/// Compared between the structures.
constexpr std::size_t kRays = 20000;

bool same_bits(const Hit& a, const Hit& b) {
  return a.primitive_id == b.primitive_id &&
         std::bit_cast<std::uint64_t>(a.t) == std::bit_cast<std::uint64_t>(b.t) &&
         std::bit_cast<std::uint64_t>(a.u) == std::bit_cast<std::uint64_t>(b.u) &&
         std::bit_cast<std::uint64_t>(a.v) == std::bit_cast<std::uint64_t>(b.v);
}

template <Precision kPrecision>
std::vector<Hit> all_hits(const Blas& blas, const std::vector<RayCase>& rays) {
  std::vector<Hit> hits(rays.size());
  tbb::parallel_for(std::size_t(0), rays.size(),
                    [&](std::size_t i) { hits[i] = blas::closest<kPrecision>(blas, rays[i]); });
  return hits;
}

/// How many rays the structure answers otherwise than `expected`, closest hit or any hit.
template <Precision kPrecision>
std::size_t differences(const Blas& blas, const std::vector<RayCase>& rays,
                        const std::vector<Hit>& expected) {
  std::vector<std::uint8_t> differs(expected.size());
  tbb::parallel_for(std::size_t(0), expected.size(), [&](std::size_t i) {
    differs[i] = !same_bits(blas::closest<kPrecision>(blas, rays[i]), expected[i]) ||
                 blas::any<kPrecision>(blas, rays[i]) != expected[i].valid();
  });
  return std::size_t(std::count(differs.begin(), differs.end(), std::uint8_t(1)));
}

template <Precision kPrecision>
void compare(const MeshCase& mesh_case, const std::vector<std::pair<std::string, Blas>>& trees,
             const std::vector<RayCase>& rays) {
  const Blas brute_force = Blas::build(mesh_case.mesh, {blas::StructureKind::kBruteForce}).value();
  const std::size_t few_total = affordable(*mesh_case.mesh, kRaysAgainstBruteForce);
  const std::vector<RayCase> few(rays.begin(),
                                 rays.begin() + std::ptrdiff_t(std::min(rays.size(), few_total)));
  const std::vector<Hit> truth = all_hits<kPrecision>(brute_force, few);
  for (const auto& [name, tree] : trees)
    EXPECT_EQ(differences<kPrecision>(tree, few, truth), 0U) << name << " against brute force";
  const std::vector<Hit> first = all_hits<kPrecision>(trees.front().second, rays);
  for (std::size_t i = 1; i < trees.size(); ++i) {
    EXPECT_EQ(differences<kPrecision>(trees[i].second, rays, first), 0U)
        << trees[i].first << " against " << trees.front().first;
  }
}

void compare_all(const std::vector<MeshCase>& meshes) {
  const std::uint64_t seed = test::seed_or(31);
  std::size_t triangles = 0;
  for (const MeshCase& mesh_case : meshes) {
    SCOPED_TRACE(mesh_case.name);
    triangles += mesh_case.mesh->triangle_count();
    std::vector<std::pair<std::string, Blas>> trees;
    for (const StructureCase& structure : tree_cases()) {
      Result<Blas> tree = Blas::build(mesh_case.mesh, structure.options);
      ASSERT_TRUE(tree.ok()) << structure.name << ": " << tree.error().message;
      const Status valid = tree->validate();
      EXPECT_TRUE(valid.ok()) << structure.name << ": " << valid.error().message << " at "
                              << valid.error().where;
      trees.emplace_back(structure.name, *std::move(tree));
    }
    blas::RayMaker maker(*mesh_case.mesh, seed);
    std::vector<RayCase> rays;
    const std::size_t ray_total = affordable(*mesh_case.mesh, ray_count(kRays));
    for (std::size_t i = 0; i < ray_total; ++i) rays.push_back(maker.any());
    compare<Precision::kRobust>(mesh_case, trees, rays);
    compare<Precision::kFast>(mesh_case, trees, rays);
  }
  std::cout << meshes.size() << " meshes, " << triangles << " triangles, " << tree_cases().size()
            << " structures, 2 precisions, " << ray_count(kRays) << " rays each\n";
}

TEST(StructuresAgree, on_generated_meshes) {
  compare_all(generated_meshes());
}

TEST(StructuresAgree, on_every_mesh_file) {
  GRIDCAST_REQUIRE_ASSET(root, test::shared_asset("meshes"));
  compare_all(meshes_below(root));
}

}  // namespace
}  // namespace gridcast::property
