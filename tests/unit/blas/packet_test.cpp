// A packet gives what its rays give one by one, bit for bit.

#include <gtest/gtest.h>

#include "core/math/instruction_set.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

struct Bundle {
  std::vector<RayCase> rays;
};

/// Rays about a middle one: from one point, to one point, or side by side; sometimes with ranges, lengths and
/// excluded triangles of their own, sometimes so far apart that no packet takes them.
Bundle bundle_around(const RayCase& middle, double size, const TriangleMesh& mesh, Random& random) {
  Bundle bundle;
  const std::uint32_t count = 1 + random.below(RayPacket::kSize);
  const double length = max_abs(middle.ray.direction);
  const double slopes = std::pow(10.0, random.uniform(-5.0, -1.2));
  const double origins = std::pow(10.0, random.uniform(-6.0, -1.5)) * size;
  const std::uint32_t kind = random.below(4);
  const bool varied = random.below(3) == 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    RayCase one = middle;
    const Vec3d bent = middle.ray.direction + slopes * length * random.in_box(1.0);
    if (kind == 0) one.ray.direction = bent;
    if (kind == 1) one.ray.origin += origins * random.in_box(1.0);
    if (kind == 2) {
      const double reach = 2.0 * size / length;
      one.ray.origin = middle.ray.origin + reach * (middle.ray.direction - bent);
      one.ray.direction = bent;
    }
    if (kind == 3) {
      one.ray.origin += origins * random.in_box(1.0);
      one.ray.direction = bent;
    }
    if (varied) {
      one.ray.direction *= random.uniform(0.1, 4.0);
      one.ray.tnear = random.uniform(-1.0, 1.0) * size / length;
      if (random.below(2) == 0) one.ray.tfar = random.uniform(0.0, 2.0) * size / length;
      if (random.below(2) == 0) one.excluded = random.below(std::uint32_t(mesh.triangle_count()));
    }
    bundle.rays.push_back(one);
  }
  return bundle;
}

RayPacket packet_of(const Bundle& bundle) {
  RayPacket packet;
  packet.count = std::uint32_t(bundle.rays.size());
  packet.instance_id = 3;
  for (std::size_t lane = 0; lane < RayPacket::kSize; ++lane) {
    const RayCase& one = bundle.rays[std::min(lane, bundle.rays.size() - 1)];
    packet.set(lane, one.ray);
    packet.excluded_primitive[lane] = one.excluded;
  }
  return packet;
}

template <Precision kPrecision>
void expect_same_as_single_rays(const Blas& blas, const Bundle& bundle, int& traced) {
  const RayPacket packet = packet_of(bundle);
  Hit best[RayPacket::kSize];
  for (std::size_t lane = 0; lane < RayPacket::kSize; ++lane) best[lane].t = packet.tfar[lane];
  const PacketResult closest = blas.intersect_packet<kPrecision>(packet, best);
  const PacketResult any = blas.occluded_packet<kPrecision>(packet);
  ASSERT_EQ(closest.traced, any.traced);
  if (!closest.traced) return;
  ++traced;
  ASSERT_EQ(closest.hits >> bundle.rays.size(), 0U);
  for (std::size_t lane = 0; lane < bundle.rays.size(); ++lane) {
    const RayCase& one = bundle.rays[lane];
    Hit expected;
    expected.t = one.ray.tfar;
    mesh::ObjectRay prepared;
    if (prepared.prepare(one.ray, blas.bounds())) {
      prepared.instance_id = 3;
      prepared.excluded_primitive = one.excluded;
      blas.intersect<kPrecision>(prepared, expected);
    }
    ASSERT_EQ(best[lane].t, expected.t) << "lane " << lane;
    ASSERT_EQ(best[lane].u, expected.u);
    ASSERT_EQ(best[lane].v, expected.v);
    ASSERT_EQ(best[lane].primitive_id, expected.primitive_id);
    ASSERT_EQ(best[lane].instance_id, expected.instance_id);
    ASSERT_EQ((closest.hits >> lane & 1U) != 0, expected.valid());
    ASSERT_EQ((any.hits >> lane & 1U) != 0, expected.valid());
  }
}

class Packet : public testing::TestWithParam<StructureKind> {};

TEST_P(Packet, every_ray_gets_the_answer_it_gets_alone) {
  const std::uint64_t seed = test::seed_or(71);
  for (const MeshCase& mesh_case : mesh_cases()) {
    SCOPED_TRACE(mesh_case.name);
    const auto blas = Blas::build(mesh_case.mesh, {GetParam()});
    ASSERT_TRUE(blas.ok());
    RayMaker maker(*mesh_case.mesh, seed);
    const double size = max_abs(to_double(mesh_case.mesh->bounds()).extent());
    int traced = 0;
    for (int i = 0; i < 1500; ++i) {
      const Bundle bundle = bundle_around(maker.any(), size, *mesh_case.mesh, maker.random());
      expect_same_as_single_rays<Precision::kRobust>(*blas, bundle, traced);
      expect_same_as_single_rays<Precision::kFast>(*blas, bundle, traced);
      if (::testing::Test::HasFatalFailure()) return;
    }
    EXPECT_GT(traced, 500) << "most bundles should be narrow enough";
  }
}

// A set of few lanes takes a block's triangles and a packet's rays in several steps, one of many in one.
TEST_P(Packet, every_instruction_set_gives_the_same_answers) {
  const std::uint64_t seed = test::seed_or(73);
  const std::string before(instruction_set());
  const auto blas = Blas::build(test::share(test::jittered_icosphere(3, 73)), {GetParam()});
  ASSERT_TRUE(blas.ok());
  for (const std::string_view name : instruction_sets()) {
    SCOPED_TRACE(name);
    ASSERT_TRUE(limit_instruction_set(name));
    RayMaker maker(blas->mesh(), seed);
    int traced = 0;
    for (int i = 0; i < 500 && !HasFatalFailure(); ++i) {
      const Bundle bundle = bundle_around(maker.any(), 2.0, blas->mesh(), maker.random());
      expect_same_as_single_rays<Precision::kRobust>(*blas, bundle, traced);
      expect_same_as_single_rays<Precision::kFast>(*blas, bundle, traced);
    }
    EXPECT_GT(traced, 150);
  }
  ASSERT_TRUE(limit_instruction_set(before));
}

TEST_P(Packet, rays_far_apart_are_left_to_the_caller) {
  const auto blas = Blas::build(test::share(test::icosphere(3)), {GetParam()});
  ASSERT_TRUE(blas.ok());
  Bundle bundle;
  Random random(test::seed_or(72));
  for (int i = 0; i < 16; ++i) bundle.rays.push_back({{Vec3d(0.0), random.direction()}, kInvalidId});
  EXPECT_FALSE(blas->occluded_packet<Precision::kRobust>(packet_of(bundle)).traced);
  bundle.rays.assign(16, bundle.rays[0]);
  EXPECT_EQ(blas->occluded_packet<Precision::kRobust>(packet_of(bundle)).hits, 0xFFFFU);
  bundle.rays[7].ray.origin += Vec3d(0.2);
  EXPECT_FALSE(blas->occluded_packet<Precision::kRobust>(packet_of(bundle)).traced);
}

INSTANTIATE_TEST_SUITE_P(Structures, Packet,
                         testing::Values(StructureKind::kWideBvh, StructureKind::kCompactBvh),
                         [](const auto& kind) { return std::string(to_string(kind.param)); });

TEST(PacketKinds, other_structures_have_none) {
  const auto blas = Blas::build(test::share(test::icosphere(3)), {StructureKind::kBvh});
  ASSERT_TRUE(blas.ok());
  EXPECT_FALSE(blas->has_packets());
  Bundle bundle;
  bundle.rays.assign(4, {{Vec3d(0.0), Vec3d(0, 0, 1)}, kInvalidId});
  EXPECT_FALSE(blas->occluded_packet<Precision::kRobust>(packet_of(bundle)).traced);
}

}  // namespace
}  // namespace gridcast::blas
