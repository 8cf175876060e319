// From inside a closed mesh no ray gets out, least of all at edges and vertices: RC05, RC06, RC15. A million
// rays per mesh, structure, class and offset:
//   GRIDCAST_RAYS=1000000 build/release/bin/property --gtest_filter='Watertight.*'

#include <atomic>
#include <iomanip>
#include <map>
#include <numbers>

#include <gtest/gtest.h>
#include <oneapi/tbb/parallel_for.h>

#include "core/math/affine.h"
#include "tests/property/meshes.h"

namespace gridcast::property {
namespace {

using blas::Blas;

constexpr std::size_t kRays = 20000;
constexpr std::size_t kOrigins = 16;
/// Brute force is a structure too, but only a small mesh can afford it.
constexpr std::size_t kBruteForceTriangles = 500;

/// How often the surface winds around `p`: the sum of the signed solid angles of its triangles over 4 pi,
/// "The solid angle of a plane triangle", A. van Oosterom, 1983. An integer up to rounding for a closed mesh.
double winding_number(const TriangleMesh& mesh, const Vec3d& p) {
  double sum = 0.0;
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    const auto corners = mesh.corners(id);
    const Vec3d a = Vec3d(corners[0]) - p;
    const Vec3d b = Vec3d(corners[1]) - p;
    const Vec3d c = Vec3d(corners[2]) - p;
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    const double volume = glm::dot(a, glm::cross(b, c));
    sum += std::atan2(volume, la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb);
  }
  return sum / (2.0 * std::numbers::pi);
}

enum class Aim { kEdge, kVertex };

/// A closed mesh placed in the world, and points of the world that are inside.
class Placement {
 public:
  Placement(const TriangleMesh& mesh, double offset, std::uint64_t seed)
      : mesh_(mesh), transform_(Affine{Mat3d(1.0), Vec3d(offset, -offset, offset)}) {
    Random random(seed);
    const double size = max_abs(to_double(mesh.bounds()).extent());
    // Below a thousand doubles across, the world cannot tell the mesh's points apart.
    if (size < 0x1p-42 * std::abs(offset)) return;
    for (int attempt = 0; attempt < 400 && origins_.size() < kOrigins; ++attempt) {
      const auto corners = mesh.corners(random.below(std::uint32_t(mesh.triangle_count())));
      const Vec3d a(corners[0]), b(corners[1]), c(corners[2]);
      const Vec3d normal = glm::cross((b - a) / size, (c - a) / size);
      const double length = glm::length(normal);
      if (!(length > 0.0)) continue;
      const double depth =
          size * std::pow(10.0, random.uniform(-7.0, -0.5)) * (attempt % 4 == 0 ? 1.0 : -1.0);
      const Vec3d world = transform_.world_from_object().point((a + b + c) / 3.0 + depth * (normal / length));
      // The rounded point is what the ray starts from, so that is what has to be inside.
      const double winding = winding_number(mesh, transform_.point_to_object(world));
      if (std::abs(winding) > 0.9 && std::abs(winding - std::round(winding)) < 0.01)
        origins_.push_back(world);
    }
  }
  [[nodiscard]] bool usable() const { return !origins_.empty(); }

  /// In object space, as an instance would get it.
  [[nodiscard]] Ray ray(Aim aim, Random& random) const {
    const Vec3d& origin = origins_[random.below(std::uint32_t(origins_.size()))];
    for (;;) {
      const auto corners = mesh_.corners(random.below(std::uint32_t(mesh_.triangle_count())));
      const std::uint32_t i = random.below(3);
      const Vec3d a(corners[i]), b(corners[(i + 1) % 3]);
      const double s = aim == Aim::kVertex ? 0.0 : random.uniform();
      const Vec3d direction = transform_.world_from_object().point(a + s * (b - a)) - origin;
      if (direction == Vec3d(0.0)) continue;
      return {transform_.point_to_object(origin), transform_.vector_to_object(direction)};
    }
  }

 private:
  const TriangleMesh& mesh_;
  InstanceTransform transform_;
  std::vector<Vec3d> origins_;
};

/// Rays that nothing stops; every second one asks for any hit, the others for the closest.
std::size_t count_leaks(const Blas& blas, const Placement& placement, Aim aim, std::size_t rays,
                        std::uint64_t seed) {
  constexpr std::size_t kBlock = 1000;
  std::atomic<std::size_t> leaks = 0;
  tbb::parallel_for(std::size_t(0), (rays + kBlock - 1) / kBlock, [&](std::size_t block) {
    Random random(seed + block);
    for (std::size_t i = block * kBlock; i < std::min(rays, (block + 1) * kBlock); ++i) {
      const blas::RayCase ray{placement.ray(aim, random)};
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
    const Placement placement(*mesh_case.mesh, offset, seed);
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
