// Refits, patches and repairs in random order leave trees that give the bits of brute force.

#include <algorithm>
#include <bit>
#include <cmath>

#include <gtest/gtest.h>

#include "core/blas/collector.h"
#include "tests/property/meshes.h"

namespace gridcast::property {
namespace {

using blas::Blas;
using blas::RayCase;

constexpr int kSteps = 30;
constexpr int kRaysAStep = 15;

bool same_bits(const Hit& a, const Hit& b) {
  const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x); };
  return a.primitive_id == b.primitive_id && bits(a.t) == bits(b.t) && bits(a.u) == bits(b.u) &&
         bits(a.v) == bits(b.v);
}

class AllHits : public blas::HitSink {
 public:
  explicit AllHits(double tfar) : HitSink(tfar) {}
  blas::Offer offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit,
                    std::uint32_t primitive_id) override {
    if (mesh::in_range(ray, hit, tfar(), primitive_id))
      hits.push_back({hit.t, hit.u, hit.v, ray.instance_id, primitive_id});
    return blas::Offer::kGoOn;
  }
  std::vector<Hit> hits;
};

/// In order, each once.
template <Precision kPrecision>
std::vector<Hit> every_hit(const Blas& tree, const RayCase& ray) {
  AllHits sink(ray.ray.tfar);
  mesh::ObjectRay prepared;
  if (!prepared.prepare(ray.ray, tree.bounds())) return {};
  prepared.instance_id = 0;
  prepared.excluded_primitive = ray.excluded;
  tree.intersect_every<kPrecision>(prepared, sink);
  std::sort(sink.hits.begin(), sink.hits.end(), closer);
  sink.hits.erase(std::unique(sink.hits.begin(), sink.hits.end(), same_bits), sink.hits.end());
  return sink.hits;
}

template <Precision kPrecision>
void expect_same_answers(const Blas& tree, const Blas& truth, std::uint64_t seed) {
  blas::RayMaker maker(tree.mesh(), seed);
  for (int i = 0; i < kRaysAStep; ++i) {
    const RayCase ray = maker.any();
    const Hit expected = blas::closest<kPrecision>(truth, ray);
    ASSERT_TRUE(same_bits(blas::closest<kPrecision>(tree, ray), expected)) << "ray " << i;
    ASSERT_EQ(blas::any<kPrecision>(tree, ray), expected.valid()) << "ray " << i;
    const auto all = every_hit<kPrecision>(tree, ray), all_expected = every_hit<kPrecision>(truth, ray);
    ASSERT_TRUE(std::equal(all.begin(), all.end(), all_expected.begin(), all_expected.end(), same_bits))
        << "ray " << i;
  }
}

/// Around a vertex, those within a part of the mesh's size.
std::vector<std::uint32_t> patch_of(const TriangleMesh& mesh, Random& random) {
  const Vec3f center = mesh.positions[random.below(std::uint32_t(mesh.positions.size()))];
  const float reach = float(random.uniform(0.02, 0.2)) * max_abs(mesh.bounds().extent());
  std::vector<std::uint32_t> patch;
  for (std::uint32_t v = 0; v < mesh.positions.size(); ++v)
    if (glm::length(mesh.positions[v] - center) <= reach) patch.push_back(v);
  return patch;
}

void change_places(TriangleMesh& mesh, const std::vector<std::uint32_t>& vertices, Random& random) {
  for (std::size_t i = vertices.size(); i > 1; --i)
    std::swap(mesh.positions[vertices[i - 1]], mesh.positions[vertices[random.below(std::uint32_t(i))]]);
}

void twist(TriangleMesh& mesh, float angle) {
  for (Vec3f& p : mesh.positions) {
    const float a = angle * p.y;
    p = {std::cos(a) * p.x - std::sin(a) * p.z, p.y, std::sin(a) * p.x + std::cos(a) * p.z};
  }
}

/// One deformation of `mesh` and the tree that follows it.
Result<Blas> deformed(const Blas& tree, const TriangleMesh& start, Random& random) {
  TriangleMesh mesh = tree.mesh();
  std::vector<std::uint32_t> vertices;
  switch (random.below(5)) {
    case 0:
      for (int i = 0; i < 5; ++i) vertices.push_back(random.below(std::uint32_t(mesh.positions.size())));
      for (const std::uint32_t v : vertices) mesh.positions[v] += Vec3f(random.in_box(0.2));
      return tree.refit(test::share(std::move(mesh)), vertices);
    case 1:
      twist(mesh, float(random.uniform(-1.0, 1.0)));
      return tree.refit(test::share(std::move(mesh)));
    case 2:
      mesh.positions = start.positions;
      return tree.refit(test::share(std::move(mesh)));
    default:
      vertices = patch_of(mesh, random);
      change_places(mesh, vertices, random);
      return tree.refit(test::share(std::move(mesh)), vertices);
  }
}

TEST(Repair, refits_patches_and_repairs_in_any_order_answer_like_brute_force) {
  const std::uint64_t seed = test::seed_or(81);
  Random random(seed);
  std::size_t repaired = 0;
  for (const TriangleMesh& start : {test::jittered_icosphere(4, 5), test::soup(6000, 6, 0.05F)}) {
    Blas tree = Blas::build(test::share(start),
                            {.kind = blas::StructureKind::kWideBvh, .spatial = blas::SpatialSplits::kNever})
                    .value();
    for (int step = 0; step < kSteps; ++step) {
      SCOPED_TRACE("step " + std::to_string(step) + ", seed " + std::to_string(seed));
      tree = deformed(tree, start, random).value();
      if (random.below(3) != 0) {
        const blas::Repair repair = tree.repair().value();
        repaired += repair.outcome == blas::RepairOutcome::kRepaired ? 1 : 0;
        tree = repair.blas;
      }
      const Status status = tree.validate();
      ASSERT_TRUE(status.ok()) << status.error().where << " " << status.error().message;
      const Blas truth = Blas::build(tree.mesh_ptr(), {blas::StructureKind::kBruteForce}).value();
      ASSERT_NO_FATAL_FAILURE(expect_same_answers<Precision::kRobust>(tree, truth, random.bits()));
      ASSERT_NO_FATAL_FAILURE(expect_same_answers<Precision::kFast>(tree, truth, random.bits()));
    }
  }
  std::cout << repaired << " repairs\n";
  EXPECT_GT(repaired, 0U);
}

}  // namespace
}  // namespace gridcast::property
