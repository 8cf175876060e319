// No ray leaves a closed mesh, wherever it is and however thin its triangles are.

#include <gtest/gtest.h>

#include "tests/stability/subject.h"
#include "tests/stability/truth.h"
#include "tests/support/closed_mesh.h"

namespace gridcast::stability {
namespace {

using test::Aim;
using test::ClosedPlacement;

/// `rays` from inside of a closed mesh to its edges or vertices: all of them hit something.
void expect_no_leak(Row& row, const std::string& spec, double offset, std::size_t rays, Aim aim) {
  const MeshSource source = generated(spec);
  const ClosedPlacement placement(*source.mesh, offset, row.seed());
  if (!placement.usable()) {
    EXPECT_NE(offset, 0.0) << spec << " has no inside";
    return;
  }
  Subject subject(placed(source, placement.world_from_object()));
  row.blocks(rays, [&](test::Random& random, std::size_t count) {
    std::vector<Shot> shots;
    for (std::size_t i = 0; i < count; ++i)
      shots.push_back({placement.world_ray(aim, random), {}, Expectation::hit()});
    subject.shoot(row, shots);
  });
}

const std::vector<std::string>& closed_meshes() {
  static const std::vector<std::string> all = {"jittered_icosphere 4 5", "torus 48 24", "organic 8000 3",
                                               "voxels 6 4"};
  return all;
}

/// A part of a row's rays, and no more than `most` of a long run's: each of them costs thousands of
/// triangles.
std::size_t costly(const Row& row, std::size_t parts, std::size_t most) {
  return std::min(row.rays(parts), most);
}

TEST(Stability, RC05_RaysThroughEdges) {
  Row row(5, 40000);
  // An edge at the tip is close to all thousand of them.
  const std::size_t tips = costly(row, 20, 20'000);
  expect_no_leak(row, "needle_fan 1000", 0.0, tips, Aim::kEdge);
  for (const std::string& spec : closed_meshes())
    expect_no_leak(row, spec, 0.0, (row.rays() - tips) / 4, Aim::kEdge);
}

TEST(Stability, RC06_RaysThroughVertices) {
  Row row(6, 40000);
  const std::size_t tips = costly(row, 40, 4'000);
  expect_no_leak(row, "needle_fan 1000", 0.0, tips, Aim::kVertex);
  // Valence 10,000.
  expect_no_leak(row, "needle_fan 20000", 0.0, costly(row, 2000, 20), Aim::kVertex);
  for (const std::string& spec : closed_meshes())
    expect_no_leak(row, spec, 0.0, (row.rays() - tips) / 4, Aim::kVertex);
}

// A third of the rays: offsets baked into the mesh's floats, where nothing is culled. The others: a small
// mesh that its instance moves, where the offset costs nothing.
TEST(Stability, RC15_LargeOffsets) {
  Row row(15, 24000);
  const double offsets[] = {1e3, 1e6, 1e9, 1e12};
  for (const double offset : offsets) {
    std::ostringstream baked;
    baked << "jittered_icosphere 2 6 | translate " << offset << ' ' << -offset << ' ' << offset;
    const MeshSource source = generated(baked.str());
    const std::size_t rays = offset > 1e4 ? row.rays(120) : row.rays(24);
    for (const Aim aim : {Aim::kEdge, Aim::kVertex}) {
      const ClosedPlacement inside(*source.mesh, 0.0, row.seed());
      if (inside.usable()) expect_no_leak(row, baked.str(), 0.0, rays, aim);
      for (const char* spec : {"jittered_icosphere 3 5", "torus 24 16 | scale 1 1e-3 1"})
        expect_no_leak(row, spec, offset, row.rays(24), aim);
    }
  }
}

// The same rays at the same instance, here and at an offset that all the sums allow: not a bit differs.
TEST(Stability, RC15_OffsetsOfInstancesCostNothing) {
  Row row(15, 8000);
  const MeshSource source = generated("jittered_icosphere 3 5");
  const Subject here(placed(source));
  for (const double offset : {1e3, 1e6, 1e9, 1e12}) {
    const Vec3d away(offset, -offset, offset);
    const Subject there(placed(source, {Mat3d(1.0), away}));
    row.blocks(row.rays(4), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> near, far;
      for (std::size_t i = 0; i < count; ++i) {
        // Multiples of 2^-12 stay what they are at 1e12.
        const Vec3d origin = glm::round(random.in_box(2.0) * 0x1p12) * 0x1p-12;
        const auto corners = source.mesh->corners(random.below(std::uint32_t(source.mesh->triangle_count())));
        const Vec3d direction =
            Vec3d(corners[0]) + random.uniform() * Vec3d(corners[1] - corners[0]) - origin;
        if (direction == Vec3d(0.0)) continue;
        near.push_back({{origin, direction}, {}, {}});
        far.push_back({{origin + away, direction}, {}, {}});
      }
      Answers expected = here.ask(row, near);
      Answers got = there.ask(row, far);
      for (const Precision precision : kPrecisions)
        for (std::size_t i = 0; i < near.size(); ++i)
          if (!same_bits(got.of(precision)[i], expected.of(precision)[i]))
            row.fail(there.spec(), far[i],
                     "at the offset " + describe(got.of(precision)[i]) + ", here " +
                         describe(expected.of(precision)[i]));
    });
  }
}

// Closed meshes of needles; isolated slivers are with the exact reference.
TEST(Stability, RC12_SliversOfClosedMeshes) {
  Row row(12, 16000);
  for (const char* squash : {"1 1e-2 1", "1 1e-4 1", "1e-6 1 1", "1e-5 1 1e-3"})
    for (const Aim aim : {Aim::kEdge, Aim::kVertex})
      expect_no_leak(row, std::string("jittered_icosphere 3 12 | scale ") + squash, 0.0, row.rays(8), aim);
}

// 64 x 64 square tiles, each an instance. At whole offsets the tiles share their edges exactly.
TEST(Stability, RC25_EdgesAcrossInstances) {
  Row row(25, 12000);
  constexpr int kTiles = 64;
  SceneSpec spec;
  spec.meshes = {generated("quad_grid 1 1")};
  for (int i = 0; i < kTiles * kTiles; ++i)
    spec.instances.push_back({0, {Mat3d(1.0), Vec3d(i % kTiles, double(i / kTiles), 0.0)}});
  Subject whole(spec);
  // A tenth of a metre is not a double: neighbours round differently.
  for (auto& [mesh, where] : spec.instances) where = {Mat3d(0.1), where.translation * 0.1};
  const Subject tenth(spec);
  std::size_t gaps = 0, aimed = 0;
  row.blocks(row.rays(), [&](test::Random& random, std::size_t count) {
    std::vector<Shot> shots, small;
    for (std::size_t i = 0; i < count; ++i) {
      // At a vertex or an edge inside of the square; origins that tiles can subtract their place from
      // exactly.
      const double x = 1.0 + random.below(kTiles - 1);
      const double y =
          random.below(2) == 0 ? 1.0 + random.below(kTiles - 1) : random.uniform(1.0, kTiles - 1.0);
      const Vec3d origin =
          glm::round(Vec3d(random.uniform(0.0, 64.0), random.uniform(0.0, 64.0), 20.0) * 0x1p10) * 0x1p-10;
      const Vec3d target = random.below(2) == 0 ? Vec3d(x, y, 0.0) : Vec3d(y, x, 0.0);
      shots.push_back({{origin, target - origin}, {}, Expectation::hit()});
      small.push_back({{0.1 * origin, 0.1 * target - 0.1 * origin}, {}, {}});
    }
    whole.shoot(row, shots);
    if (aimed > 4096) return;
    Answers answers = tenth.ask(row, small);
    aimed += small.size();
    for (const SurfaceHit& hit : answers.robust) gaps += std::size_t(hit.status != RayStatus::kHit);
  });
  std::cout << "tiles of a tenth: " << gaps << " of " << aimed
            << " rays at shared edges pass between instances (not promised by robust)\n";
}

// Two sides of a square, tessellated differently: what is a gap in the floats is a miss, nothing is healed.
TEST(Stability, RC08_TJunctions) {
  Row row(8, 6000);
  // Left of x = 0 one triangle along the side from (0,0,0) to (0,1,0), right of it two, which meet at (0,
  // 0.5, 0) exactly (no gap) or at a point pushed to either side by 2^-20 (a gap or an overlap as wide as
  // that).
  for (const float push : {0.F, 0x1p-20F, -0x1p-20F}) {
    mesh::TriangleMesh mesh;
    mesh.positions = {{0, 0, 0},       {0, 1, 0}, {-1, 0.5F, 0}, {0, 0, 0},
                      {push, 0.5F, 0}, {0, 1, 0}, {1, 0.5F, 0}};
    mesh.triangles = {{0, 1, 2}, {3, 6, 4}, {4, 6, 5}};
    Subject subject(placed(given(mesh)));
    row.blocks(row.rays(3), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < count; ++i) {
        // Straight down, so that the projection is exact: x beside the seam, the gap's border is at
        // x = push * 2 min(y, 1 - y).
        const double y = double(1 + random.below(1023)) * 0x1p-10;
        const double border = 2.0 * double(push) * std::min(y, 1.0 - y);
        const double steps[] = {
            0.0, border, 0.5 * border, 2.0 * border, border + 0x1p-60, border - 0x1p-60, 0x1p-60, -0x1p-60};
        const double x = steps[random.below(8)];
        const bool left = x <= 0.0, right = x >= border;
        const Expectation expected =
            left ? Expectation::hit({0, 0}, 1.0) : (right ? Expectation::hit({}, 1.0) : Expectation::miss());
        shots.push_back({{{x, y, 1.0}, {0.0, 0.0, -1.0}}, {}, expected});
      }
      subject.shoot(row, shots);
    });
  }
}

}  // namespace
}  // namespace gridcast::stability
