// Trees as bytes: what comes back is the tree that was written, and bytes that lie do no harm.

#include "core/blas/tree_codec.h"

#include <array>
#include <cstring>

#include <gtest/gtest.h>

#include "tests/support/lying_tree.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

std::vector<StructureCase> encodable_cases() {
  std::vector<StructureCase> cases = structure_cases();
  std::erase_if(cases, [](const StructureCase& c) { return c.options.kind == StructureKind::kEmbree; });
  return cases;
}

std::string bytes_of(const Blas& blas) {
  return encode_tree(blas).value();
}

Blas decoded(const Blas& blas) {
  auto made = decode_tree(blas.mesh_ptr(), bytes_of(blas));
  EXPECT_TRUE(made.ok()) << made.error().message << " " << made.error().where;
  return made ? *made : blas;
}

template <Precision kPrecision>
void expect_same_answer(const Blas& a, const Blas& b, const RayCase& ray) {
  const Hit x = closest<kPrecision>(a, ray), y = closest<kPrecision>(b, ray);
  ASSERT_EQ(x.t, y.t);
  ASSERT_EQ(x.u, y.u);
  ASSERT_EQ(x.v, y.v);
  ASSERT_EQ(x.primitive_id, y.primitive_id);
  ASSERT_EQ(any<kPrecision>(a, ray), any<kPrecision>(b, ray));
}

void expect_same_stats(const StructureStats& a, const StructureStats& b) {
  EXPECT_EQ(a.kind, b.kind);
  EXPECT_EQ(a.reason, b.reason);
  EXPECT_EQ(a.triangle_count, b.triangle_count);
  EXPECT_EQ(a.node_count, b.node_count);
  EXPECT_EQ(a.leaf_count, b.leaf_count);
  EXPECT_EQ(a.reference_count, b.reference_count);
  EXPECT_EQ(a.max_depth, b.max_depth);
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.cost_at_build, b.cost_at_build);
  EXPECT_EQ(a.looseness, b.looseness);
  EXPECT_EQ(a.looseness_at_build, b.looseness_at_build);
  EXPECT_EQ(a.build_ms, b.build_ms);
  EXPECT_EQ(a.refits_since_build, b.refits_since_build);
}

class EncodedTree : public testing::TestWithParam<StructureCase> {};

TEST_P(EncodedTree, what_comes_back_is_the_tree_that_was_written) {
  for (const MeshCase& mesh_case : mesh_cases()) {
    SCOPED_TRACE(mesh_case.name);
    const Blas blas = Blas::build(mesh_case.mesh, GetParam().options).value();
    if (!is_encodable(blas.stats().kind)) continue;  // auto: a handful of triangles
    const Blas again = decoded(blas);
    ASSERT_TRUE(bytes_of(again) == bytes_of(blas));
    expect_same_stats(again.stats(), blas.stats());
    EXPECT_EQ(again.mesh_ptr(), blas.mesh_ptr());
    EXPECT_EQ(again.bounds(), blas.bounds());
    EXPECT_EQ(again.has_packets(), blas.has_packets());
    const Status valid = again.validate();
    EXPECT_TRUE(valid.ok()) << valid.error().message << " " << valid.error().where;
    RayMaker maker(*mesh_case.mesh, test::seed_or(31));
    for (int i = 0; i < 200 && !testing::Test::HasFatalFailure(); ++i) {
      const RayCase ray = maker.any();
      expect_same_answer<Precision::kRobust>(blas, again, ray);
      expect_same_answer<Precision::kFast>(blas, again, ray);
    }
  }
}

// The bytes hold all that a refit draws, so trees with the same bytes are the same trees.
TEST_P(EncodedTree, refits_and_repairs_of_it_are_those_of_the_original) {
  TriangleMesh mesh = test::jittered_icosphere(4, 3);
  const Blas blas = Blas::build(test::share(mesh), GetParam().options).value();
  const Blas again = decoded(blas);
  if (!blas.can_refit()) {
    EXPECT_FALSE(again.can_refit());
    return;
  }
  Random random(test::seed_or(32));
  for (Vec3f& p : mesh.positions)
    if (p.y > 0.5F) p += Vec3f(random.in_box(0.4));
  const auto moved = test::share(mesh);
  const Blas refitted = blas.refit(moved).value(), refitted_again = again.refit(moved).value();
  EXPECT_TRUE(bytes_of(refitted) == bytes_of(refitted_again));

  // And once more, from a tree that had been refitted when it was written.
  const Blas kept = decoded(refitted);
  EXPECT_TRUE(bytes_of(kept) == bytes_of(refitted));
  mesh.positions[7] += Vec3f(0.01F);
  const auto patched = test::share(mesh);
  const std::vector<std::uint32_t> vertices{7};
  EXPECT_TRUE(bytes_of(kept.refit(patched, vertices).value()) ==
              bytes_of(refitted.refit(patched, vertices).value()));
  const auto repair = refitted.repair(), repair_again = kept.repair();
  ASSERT_EQ(repair.ok(), repair_again.ok());
  if (!repair) return;
  EXPECT_EQ(repair->outcome, repair_again->outcome);
  EXPECT_EQ(repair->cost_after, repair_again->cost_after);
  EXPECT_TRUE(bytes_of(repair->blas) == bytes_of(repair_again->blas));
}

TEST_P(EncodedTree, bytes_that_are_cut_lengthened_or_of_another_mesh_are_refused) {
  const auto mesh = test::share(test::icosphere(2));
  const Blas blas = Blas::build(mesh, GetParam().options).value();
  const std::string bytes = bytes_of(blas);
  for (std::size_t size = 0; size < bytes.size(); size += size < 200 ? 1 : 37)
    EXPECT_FALSE(decode_tree(mesh, std::string_view(bytes).substr(0, size)).ok()) << size;
  EXPECT_FALSE(decode_tree(mesh, bytes + '\0').ok());
  EXPECT_FALSE(decode_tree(test::share(test::icosphere(3)), bytes).ok());
  EXPECT_FALSE(decode_tree(test::share(test::torus(16, 10)), bytes).ok());
  EXPECT_TRUE(decode_tree(mesh, bytes).ok());

  std::string foreign = bytes;
  foreign[4] = char(kTreeFormat + 1);
  EXPECT_EQ(decode_tree(mesh, foreign).error().code, ErrorCode::kUnsupported);
}

// Every byte of a small tree with a bit turned, and every word replaced by two of what hurts most.
TEST_P(EncodedTree, bytes_that_lie_are_refused_or_do_no_harm) {
  const auto mesh = test::share(test::icosphere(1));
  const std::string bytes = bytes_of(Blas::build(mesh, GetParam().options).value());
  std::size_t accepted = 0, refused = 0;
  const auto ask = [&](const std::string& lie) {
    const auto made = decode_tree(mesh, lie);
    (made ? accepted : refused) += 1;
    if (made) test::use_every_way(*made, *mesh);
  };
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    std::string lie = bytes;
    lie[at] = char(lie[at] ^ char(1U << (at % 8)));
    ask(lie);
  }
  constexpr std::array<std::uint32_t, 8> kWords{0,           1,           0x7F,        0x7F800000U,
                                                0x7FC00000U, 0x80000001U, 0xC0000000U, ~0U};
  for (std::size_t at = 0; at + 4 <= bytes.size(); at += 4) {
    for (const std::size_t which : {at / 4 % 8, (at / 4 + 3) % 8}) {
      std::string lie = bytes;
      std::memcpy(lie.data() + at, &kWords[which], sizeof kWords[which]);
      ask(lie);
    }
  }
  EXPECT_GT(accepted, 0U) << "some lies are only worse boxes";
  EXPECT_GT(refused, bytes.size() / 16);
}

INSTANTIATE_TEST_SUITE_P(Structures, EncodedTree, testing::ValuesIn(encodable_cases()),
                         [](const auto& tested) { return tested.param.name; });

TEST(EncodedTreeKinds, what_has_nothing_to_keep_is_told) {
  const auto mesh = test::share(test::icosphere(2));
  for (const StructureKind kind : {StructureKind::kBruteForce, StructureKind::kEmbree}) {
    EXPECT_FALSE(is_encodable(kind));
    EXPECT_EQ(encode_tree(Blas::build(mesh, {kind}).value()).error().code, ErrorCode::kUnsupported);
  }
}

TEST(EncodedTreeKinds, a_mesh_without_triangles_has_a_tree_too) {
  const auto mesh = test::share(TriangleMesh{});
  for (const StructureKind kind :
       {StructureKind::kBvh, StructureKind::kWideBvh, StructureKind::kCompactBvh, StructureKind::kKdTree}) {
    const auto made = decode_tree(mesh, bytes_of(Blas::build(mesh, {kind}).value()));
    ASSERT_TRUE(made.ok()) << made.error().message;
    EXPECT_EQ(made->stats().kind, kind);
  }
}

}  // namespace
}  // namespace gridcast::blas
