// From inside a closed mesh no ray gets out, least of all at edges and vertices: RC05, RC06, RC15. A million
// rays per mesh, structure, class and offset:
//   GRIDCAST_RAYS=1000000 build/release/bin/property --gtest_filter='Watertight.*'

#include <atomic>
#include <iomanip>
#include <map>

#include <gtest/gtest.h>
#include <oneapi/tbb/parallel_for.h>

#include "tests/property/meshes.h"
#include "tests/support/closed_mesh.h"

namespace gridcast::property {
namespace {

using blas::Blas;
using test::Aim;
using test::ClosedPlacement;
using test::winding_number;

constexpr std::size_t kRays = 20000;
/// Brute force is a structure too, but only a small mesh can afford it.
constexpr std::size_t kBruteForceTriangles = 500;

/// Rays that nothing stops; every second one asks for any hit, the others for the closest.
std::size_t count_leaks(const Blas& blas, const ClosedPlacement& placement, Aim aim, std::size_t rays,
                        std::uint64_t seed) {
  constexpr std::size_t kBlock = 1000;
  std::atomic<std::size_t> leaks = 0;
  tbb::parallel_for(std::size_t(0), (rays + kBlock - 1) / kBlock, [&](std::size_t block) {
    Random random(seed + block);
    for (std::size_t i = block * kBlock; i < std::min(rays, (block + 1) * kBlock); ++i) {
      const blas::RayCase ray{placement.object_ray(aim, random)};
      const bool hit = i % 2 == 0 ? blas::any<Precision::kRobust>(blas, ray)
                                  : blas::closest<Precision::kRobust>(blas, ray).valid();
      leaks += std::size_t(!hit);
    }
  });
  return leaks;
}

struct Tally {
  std::size_t leaks = 0;
  std::size_t rays = 0;
};

std::ostream& operator<<(std::ostream& out, const Tally& tally) {
  out << tally.leaks << " leaks in " << tally.rays;
  if (tally.leaks == 0) out << " (below " << std::setprecision(2) << 3.0 / double(tally.rays) << ")";
  return out;
}

void check(const MeshCase& mesh_case, std::uint64_t seed, std::map<std::string, Tally>& totals) {
  std::vector<StructureCase> structures = tree_cases();
  if (mesh_case.mesh->triangle_count() <= kBruteForceTriangles)
    structures.push_back({"brute_force", {blas::StructureKind::kBruteForce}});
  std::vector<Blas> built;
  for (const StructureCase& structure : structures)
    built.push_back(Blas::build(mesh_case.mesh, structure.options).value());

  for (const double offset : {0.0, 1e6}) {
    const ClosedPlacement placement(*mesh_case.mesh, offset, seed);
    std::cout << std::left << std::setw(24) << mesh_case.name << " offset " << std::setw(7) << offset;
    if (!placement.usable()) {
      std::cout << " left out: too small for the doubles there\n";
      EXPECT_NE(offset, 0.0);
      continue;
    }
    Tally here[2];
    for (const Aim aim : {Aim::kEdge, Aim::kVertex}) {
      for (std::size_t i = 0; i < structures.size(); ++i) {
        const std::size_t rays = affordable(*mesh_case.mesh, ray_count(kRays));
        const std::size_t leaks = count_leaks(built[i], placement, aim, rays, seed);
        EXPECT_EQ(leaks, 0U) << structures[i].name << " on " << mesh_case.name << " at offset " << offset;
        for (Tally* tally : {&here[int(aim)], &totals[structures[i].name]}) {
          tally->leaks += leaks;
          tally->rays += rays;
        }
      }
    }
    std::cout << " edges: " << here[0] << ", vertices: " << here[1] << std::endl;
  }
}

void check_all(const std::vector<MeshCase>& meshes) {
  const std::uint64_t seed = test::seed_or(47);
  std::map<std::string, Tally> totals;
  for (const MeshCase& mesh_case : meshes)
    if (encloses_space(*mesh_case.mesh)) check(mesh_case, seed, totals);
  ASSERT_FALSE(totals.empty()) << "no closed mesh";
  for (const auto& [structure, tally] : totals) std::cout << structure << ": " << tally << "\n";
}

TEST(Watertight, winding_number_is_one_inside_and_zero_outside) {
  const TriangleMesh sphere = test::icosphere(3);
  EXPECT_NEAR(winding_number(sphere, Vec3d(0.3, 0.2, -0.9) * 0.9), 1.0, 1e-9);
  EXPECT_NEAR(winding_number(sphere, Vec3d(0.3, 0.2, -0.9) * 1.2), 0.0, 1e-9);
}

TEST(Watertight, no_ray_leaves_a_generated_closed_mesh) {
  check_all(generated_meshes());
}

TEST(Watertight, no_ray_leaves_any_closed_mesh_file) {
  GRIDCAST_REQUIRE_ASSET(root, test::shared_asset("meshes"));
  check_all(meshes_below(root));
}

}  // namespace
}  // namespace gridcast::property
