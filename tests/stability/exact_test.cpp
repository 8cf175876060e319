// Meshes where their files have them, so that the engine decides about the very rays that the exact reference
// gets: grazing rays, isolated slivers, and every hit of a ray.

#include <gtest/gtest.h>

#include "core/scene/all_hits.h"
#include "tests/stability/exact_subject.h"
#include "tests/stability/shot_batch.h"
#include "tests/support/closed_mesh.h"
#include "tests/support/exact_reference.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::stability {
namespace {

using blas::StructureKind;

constexpr StructureKind kKinds[] = {StructureKind::kBruteForce, StructureKind::kBvh, StructureKind::kWideBvh,
                                    StructureKind::kCompactBvh, StructureKind::kKdTree};

/// All hits of a batch in one structure.
HitLists all_hits(const scene::Scene& scene, const std::vector<Shot>& shots,
                  const scene::AllHitsOptions& options = {}) {
  return scene::intersect_all(scene, batch_of(rows_of(shots)), options).value();
}

/// Towards a point of the closed triangle at an angle of `slope` to it.
Ray grazing(const mesh::TriangleMesh& mesh, double slope, test::Random& random) {
  const auto corners = mesh.corners(random.below(std::uint32_t(mesh.triangle_count())));
  const Vec3d edge(corners[1] - corners[0]), other(corners[2] - corners[0]);
  const double u = random.below(3) == 0 ? 0.0 : random.uniform(), v = random.uniform(0.0, 1.0 - u);
  const Vec3d target = Vec3d(corners[0]) + u * edge + v * other;
  Vec3d along = random.uniform(-1.0, 1.0) * edge + random.uniform(-1.0, 1.0) * other;
  const Vec3d normal = glm::cross(edge, other);
  if (!(glm::length(along) > 0.0) || !(glm::length(normal) > 0.0))
    along = Vec3d(1.0, 0.0, 0.0);
  else
    along = along / glm::length(along) + slope * normal / glm::length(normal);
  return {target - random.uniform(0.1, 4.0) * along, along};
}

TEST(Stability, RC09_GrazingRays) {
  Row row(9, 7000);
  const char* const specs[] = {"jittered_icosphere 2 9", "box -1 -1 0 1 1 1e-3", "soup 200 9 0.5",
                               "slivers 200 9 1e2", "jittered_icosphere 2 9 | translate 1e4 -1e4 1e4"};
  for (const char* spec : specs) {
    ExactSubject subject(placed(generated(spec)));
    const mesh::TriangleMesh& mesh = *subject.subject().spec().meshes[0].mesh;
    row.blocks(row.rays(std::size(specs)), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < count; ++i) {
        const double slope = i % 8 == 7 ? 0.0 : std::pow(10.0, -1.0 - double(i % 8));
        const Ray ray = grazing(mesh, (random.below(2) == 0 ? 1.0 : -1.0) * slope, random);
        if (is_valid(ray)) shots.push_back({ray, {}, {}});
      }
      subject.shoot(row, std::move(shots));
    });
    EXPECT_GT(subject.seen().bounded_share(), 0.9) << spec << ": the bounds say nothing";
  }
}

TEST(Stability, RC12_IsolatedSlivers) {
  Row row(12, 5000);
  const char* const aspects[] = {"1e2", "1e4", "1e6", "1e8"};
  for (const char* aspect : aspects) {
    ExactSubject subject(placed(generated(std::string("slivers 400 12 ") + aspect)));
    blas::RayMaker maker(*subject.subject().spec().meshes[0].mesh, row.seed());
    row.blocks(row.rays(std::size(aspects)), [&](test::Random&, std::size_t count) {
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < count; ++i) {
        // Ends of the range are for RC20: a t within rounding of one may go either way.
        Ray ray = i % 2 == 0 ? maker.at_edge() : i % 4 == 1 ? maker.at_vertex() : maker.through_space();
        if (is_valid(ray)) shots.push_back({ray, {}, {}});
      }
      subject.shoot(row, std::move(shots));
    });
    EXPECT_GT(subject.seen().bounded_share(), 0.9) << aspect << ": the bounds say nothing";
  }
}

std::vector<std::shared_ptr<const scene::Scene>> in_all_structures(const SceneSpec& spec) {
  std::vector<std::shared_ptr<const scene::Scene>> all;
  for (const StructureKind kind : kKinds) {
    scene::SceneBuildOptions options;
    options.blas.kind = kind;
    all.push_back(scene::build_scene(scene_data(spec), options).value());
  }
  return all;
}

// Crossings and windings of closed meshes, from inside and outside, to edges and vertices that triangles
// share.
TEST(Stability, RC07_ParityAtEdgesAndVertices) {
  Row row(7, 8000);
  const char* const specs[] = {"jittered_icosphere 3 7", "torus 24 16", "voxels 4 7", "needle_fan 200"};
  for (const char* spec : specs) {
    const MeshSource source = generated(spec);
    const auto scenes = in_all_structures(placed(source));
    const Bounds3d box = to_double(source.mesh->bounds());
    row.blocks(row.rays(std::size(specs)), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      std::vector<int> windings;
      while (shots.size() < count) {
        const Vec3d origin = box.center() + 0.7 * box.extent() * random.in_box(1.0);
        const double winding = test::winding_number(*source.mesh, origin);
        // On the surface there is none.
        if (std::abs(winding - std::round(winding)) > 1e-6) continue;
        const auto corners = source.mesh->corners(random.below(std::uint32_t(source.mesh->triangle_count())));
        const double s = random.below(2) == 0 ? 0.0 : random.uniform();
        const Vec3d target = Vec3d(corners[0]) + s * Vec3d(corners[1] - corners[0]);
        shots.push_back({{origin, target - origin}, {}, {}});
        windings.push_back(int(std::round(winding)));
      }
      const std::vector<double> rows = rows_of(shots);
      for (const auto& scene : scenes) {
        const HitCounts counts = scene::count_hits(*scene, batch_of(rows), {}).value();
        for (std::size_t i = 0; i < shots.size(); ++i) {
          if (counts.winding[i] != windings[i])
            row.fail(
                placed(source), shots[i],
                "winds " + std::to_string(counts.winding[i]) + " times, not " + std::to_string(windings[i]));
          if ((int(counts.crossings[i]) - windings[i]) % 2 != 0)
            row.fail(placed(source), shots[i], "the parity of the crossings is wrong");
        }
      }
      row.count(count, count * scenes.size());
    });
  }
}

// A thousand coincident layers of two instances, page by page: nothing is lost, nothing comes twice, and the
// whole is the exact reference's list.
TEST(Stability, RC21_NextHits) {
  Row row(21, 60);
  SceneSpec spec;
  spec.meshes = {generated("quad_grid 2 1 | repeat 500"), generated("soup 300 21 0.8")};
  spec.instances = {{0, {}}, {0, {}}, {1, {}}};
  const auto scenes = in_all_structures(spec);
  const test::ExactScene exact(scene_data(spec));
  row.blocks(row.rays(), [&](test::Random& random, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      // Multiples of 2^-6, an edge or a vertex of the layers now and then.
      const double x = double(random.below(65)) / 64.0, y = double(random.below(65)) / 64.0;
      const std::vector<Shot> shots = {{{{x, y, 2.0}, {0.0, 0.0, -1.0}}, {}, {}}};
      const auto expected = exact->all(shots[0].ray);
      for (const auto& scene : scenes) {
        scene::AllHitsOptions options;
        options.max_hits = 1 + random.below(400);
        std::vector<HitPosition> after(1);
        std::vector<PrimitiveRef> got;
        for (std::size_t page = 0; page <= expected.size(); ++page) {
          if (page > 0) options.after = after;
          const HitLists list = all_hits(*scene, shots, options);
          const std::size_t n = list.splits[1];
          for (std::size_t k = 0; k < n; ++k)
            got.push_back({list.hits.instance_id[k], list.hits.primitive_id[k]});
          if (n > 0)
            after[0] = {list.hits.t[n - 1], list.hits.instance_id[n - 1], list.hits.primitive_id[n - 1]};
          if (list.status[0] != RayStatus::kTruncated) break;
        }
        bool same = got.size() == expected.size();
        for (std::size_t k = 0; same && k < got.size(); ++k) same = got[k] == expected[k].primitive;
        if (!same)
          row.fail(
              spec, shots[0],
              std::to_string(got.size()) + " hits in pages, not those " + std::to_string(expected.size()));
      }
    }
    row.count(count, count * scenes.size());
  });
}

}  // namespace
}  // namespace gridcast::stability
