#include "core/mesh/deform.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include "tests/support/deform_reference.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::mesh {
namespace {

using Wide = long double;

struct Rig {
  TriangleMesh mesh;
  MeshDeformation deformation;
  std::vector<double> weights;
  std::vector<Affine> joints;
};

Affine random_joint(test::Random& random, double offset) {
  Affine joint;
  for (int c = 0; c < 3; ++c) joint.linear[c] = random.in_box(1.5);
  joint.translation = random.in_box(2.0) + Vec3d(offset, -offset, 0.5 * offset);
  return joint;
}

/// A rig of any counts: targets dense, sparse and of normals alone, weights of any sum, some of zero.
Rig random_rig(test::Random& random, std::uint32_t influences, std::size_t targets, std::uint32_t joints,
               double offset) {
  Rig rig;
  rig.mesh = test::jittered_icosphere(influences == 8 ? 5 : 4, random.bits());
  rig.mesh.normals = rig.mesh.positions;
  for (Vec3f& n : rig.mesh.normals) n = glm::normalize(n);
  const std::size_t count = rig.mesh.positions.size();
  for (std::size_t t = 0; t < targets; ++t) {
    MorphTarget target;
    const bool sparse = random.below(2) == 0;
    for (std::size_t v = 0; v < count; ++v) {
      if (sparse && random.below(10) != 0) continue;
      if (sparse) target.vertex_ids.push_back(std::uint32_t(v));
      target.positions.emplace_back(random.in_box(0.5));
      target.normals.emplace_back(random.in_box(0.1));
    }
    rig.deformation.morph_targets.push_back(target);
    rig.weights.push_back(random.below(4) == 0 ? 0.0 : random.uniform(-1.0, 2.0));
  }
  rig.deformation.influences = influences;
  for (std::size_t i = 0; i < count * influences; ++i) {
    rig.deformation.joints.push_back(std::uint16_t(random.below(joints)));
    const bool none = (i / influences) % 7 == 0 || random.below(3) == 0;
    rig.deformation.weights.push_back(none ? 0.F : float(random.uniform(0.0, 3.0)));
  }
  for (std::uint32_t j = 0; influences != 0 && j < joints; ++j)
    rig.joints.push_back(random_joint(random, offset));
  EXPECT_TRUE(validate(rig.deformation, count).ok());
  return rig;
}

void expect_reference(const Rig& rig) {
  const DeformedVertices got = deform(rig.mesh, rig.deformation, rig.weights, rig.joints);
  ASSERT_EQ(got.positions.size(), rig.mesh.positions.size());
  const long double steps = 0x1p-53L * (32.0L + Wide(rig.weights.size()));
  for (std::size_t v = 0; v < got.positions.size(); ++v) {
    const auto want = test::reference_position(rig.mesh, rig.deformation, rig.weights, rig.joints, v);
    for (int axis = 0; axis < 3; ++axis) {
      const long double exact = want.position[std::size_t(axis)];
      const long double bound = 0x1p-24L * std::abs(exact) + steps * want.magnitude[std::size_t(axis)];
      ASSERT_LE(std::abs(Wide(got.positions[v][axis]) - exact), bound) << "vertex " << v << ", " << axis;
    }
    ASSERT_NEAR(glm::length(Vec3d(got.normals[v])), 1.0, 1e-6);
  }
}

TEST(Deform, every_vertex_is_where_wide_arithmetic_puts_it_within_the_stated_bound) {
  test::Random random(test::seed_or(61));
  for (const std::uint32_t influences : {0U, 4U, 8U}) {
    for (const std::size_t targets : {0U, 1U, 8U, 40U}) {
      for (const std::uint32_t joints : {1U, 24U, 300U}) {
        for (const double offset : {0.0, 1e6}) {
          SCOPED_TRACE(testing::Message() << influences << " influences, " << targets << " targets, "
                                          << joints << " joints at " << offset);
          ASSERT_NO_FATAL_FAILURE(expect_reference(random_rig(random, influences, targets, joints, offset)));
        }
      }
    }
  }
}

TEST(Deform, the_result_does_not_depend_on_the_number_of_threads) {
  test::Random random(test::seed_or(62));
  Rig rig = random_rig(random, 8, 9, 50, 3.0);
  const DeformedVertices many = deform(rig.mesh, rig.deformation, rig.weights, rig.joints);
  tbb::task_arena one(1);
  const auto alone = one.execute([&] { return deform(rig.mesh, rig.deformation, rig.weights, rig.joints); });
  EXPECT_EQ(many.positions, alone.positions);
  EXPECT_EQ(many.normals, alone.normals);
}

TEST(Deform, sparse_targets_move_what_dense_ones_do_and_take_less_memory) {
  test::Random random(test::seed_or(63));
  Rig rig = random_rig(random, 4, 0, 5, 0.0);
  rig.weights = {0.7};
  MorphTarget dense;
  dense.positions.assign(rig.mesh.positions.size(), Vec3f(0.F));
  dense.normals = dense.positions;
  for (std::size_t v = 5; v < dense.positions.size(); v += 31) dense.positions[v] = Vec3f(random.in_box(1.0));
  dense.normals[77] = {0.F, 1.F, 0.F};
  rig.deformation.morph_targets = {dense};
  const auto from_dense = deform(rig.mesh, rig.deformation, rig.weights, rig.joints);
  const std::size_t dense_bytes = rig.deformation.memory_bytes();
  make_sparse(rig.deformation.morph_targets[0]);
  ASSERT_FALSE(rig.deformation.morph_targets[0].vertex_ids.empty());
  ASSERT_TRUE(validate(rig.deformation, rig.mesh.positions.size()).ok());
  const auto from_sparse = deform(rig.mesh, rig.deformation, rig.weights, rig.joints);
  EXPECT_EQ(from_dense.positions, from_sparse.positions);
  EXPECT_EQ(from_dense.normals, from_sparse.normals);
  EXPECT_LT(rig.deformation.memory_bytes(), dense_bytes);

  MorphTarget everywhere{std::vector<Vec3f>(9, Vec3f(1.F)), {}, {}};
  make_sparse(everywhere);
  EXPECT_TRUE(everywhere.vertex_ids.empty());
  MorphTarget nowhere{std::vector<Vec3f>(9, Vec3f(0.F)), {}, {}};
  make_sparse(nowhere);
  EXPECT_TRUE(nowhere.positions.empty());
}

/// A quad grid whose vertices follow two joints by their height.
Rig tube(double turn_rad) {
  Rig rig;
  rig.mesh = test::quad_grid(8);
  rig.mesh.normals.assign(rig.mesh.positions.size(), Vec3f(0, 0, 1));
  rig.deformation.influences = 4;
  for (const Vec3f& p : rig.mesh.positions) {
    const float upper = std::clamp(p.y, 0.F, 1.F);
    rig.deformation.joints.insert(rig.deformation.joints.end(), {0, 1, 0, 0});
    rig.deformation.weights.insert(rig.deformation.weights.end(), {1.F - upper, upper, 0.F, 0.F});
  }
  const double c = std::cos(turn_rad), s = std::sin(turn_rad);
  rig.joints = {Affine{}, Affine{Mat3d(c, 0, -s, 0, 1, 0, s, 0, c), Vec3d(0.0)}};
  return rig;
}

TEST(Deform, degenerate_rigs_follow_the_stated_rules) {
  constexpr double kPi = 3.14159265358979323846;
  // Twisted by half a turn: the middle collapses onto the axis, nothing is NaN.
  const Rig wrapper = tube(kPi);
  ASSERT_NO_FATAL_FAILURE(expect_reference(wrapper));

  // A joint that collapses everything: a point, with normals that stay.
  Rig collapsed = tube(0.0);
  collapsed.joints = {Affine{Mat3d(0.0), Vec3d(1, 2, 3)}, Affine{Mat3d(0.0), Vec3d(1, 2, 3)}};
  const auto point = deform(collapsed.mesh, collapsed.deformation, {}, collapsed.joints);
  for (const Vec3f& p : point.positions) EXPECT_EQ(p, Vec3f(1, 2, 3));
  EXPECT_EQ(point.normals, collapsed.mesh.normals);

  // No weight at all: the first joint alone.
  Rig unbound = tube(1.0);
  unbound.joints[0].translation = {5, 0, 0};
  unbound.deformation.weights.assign(unbound.deformation.weights.size(), 0.F);
  const auto moved = deform(unbound.mesh, unbound.deformation, {}, unbound.joints);
  for (std::size_t v = 0; v < moved.positions.size(); ++v)
    EXPECT_EQ(moved.positions[v], unbound.mesh.positions[v] + Vec3f(5, 0, 0));

  // Weights that sum to 3 are the same weights.
  Rig heavy = tube(0.7);
  const auto normal = deform(heavy.mesh, heavy.deformation, {}, heavy.joints);
  for (float& w : heavy.deformation.weights) w *= 4.F;
  EXPECT_EQ(deform(heavy.mesh, heavy.deformation, {}, heavy.joints).positions, normal.positions);

  // A NaN matrix gives what validate_positions refuses.
  Rig broken = tube(0.0);
  broken.joints[0].linear[1][1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(validate_positions(deform(broken.mesh, broken.deformation, {}, broken.joints).positions).ok());
}

TEST(Deform, normals_turn_with_the_surface_under_scale_and_mirroring) {
  Rig rig = tube(0.0);
  for (const Affine& joint :
       {Affine{Mat3d(1, 0, 0, 0, 3, 0, 0.5, 0, 2), {}}, Affine{Mat3d(-1, 0, 0, 0, 1, 0, 0, 0, 1), {}},
        Affine{Mat3d(1, 0, 4, 0, 1, 0, 0, 0, 1), Vec3d(9.0)}}) {
    rig.joints = {joint, joint};
    const auto out = deform(rig.mesh, rig.deformation, {}, rig.joints);
    for (std::uint32_t k = 0; k < rig.mesh.triangle_count(); ++k) {
      const Triangle& t = rig.mesh.triangles[k];
      const Vec3d a(out.positions[t[0]]), b(out.positions[t[1]]), c(out.positions[t[2]]);
      const Vec3d face = glm::normalize(glm::cross(b - a, c - a));
      EXPECT_NEAR(glm::dot(face, Vec3d(out.normals[t[0]])), 1.0, 1e-6);
    }
  }
}

TEST(DeformationValidate, the_offending_array_is_named) {
  const auto error = [](auto change) {
    test::Random random(64);
    Rig rig = random_rig(random, 4, 2, 3, 0.0);
    change(rig.deformation);
    const Status status = validate(rig.deformation, rig.mesh.positions.size());
    return status.ok() ? std::string("valid") : status.error().where;
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(error([](MeshDeformation&) {}), "valid");
  EXPECT_EQ(error([](MeshDeformation& d) { d.joints.pop_back(); }), "/joints");
  EXPECT_EQ(error([](MeshDeformation& d) { d.weights.pop_back(); }), "/weights");
  EXPECT_EQ(error([&](MeshDeformation& d) { d.weights[3] = nan; }), "/weights");
  EXPECT_EQ(error([](MeshDeformation& d) { d.influences = 3; }), "/influences");
  EXPECT_EQ(error([](MeshDeformation& d) { d.default_weights.assign(3, 0.F); }), "/default_weights");
  EXPECT_EQ(error([](MeshDeformation& d) { d.morph_targets[1].positions.pop_back(); }),
            "/morph_targets/1/positions");
  EXPECT_EQ(error([](MeshDeformation& d) { d.morph_targets[1].normals.pop_back(); }),
            "/morph_targets/1/normals");
  EXPECT_EQ(error([&](MeshDeformation& d) { d.morph_targets[0].positions[0].x = nan; }),
            "/morph_targets/0/positions");
  EXPECT_EQ(error([](MeshDeformation& d) {
              d.morph_targets[0] = {{Vec3f(0), Vec3f(0)}, {}, {5, 5}};
            }),
            "/morph_targets/0/vertex_ids");
  EXPECT_EQ(error([](MeshDeformation& d) {
              d.morph_targets[0] = {{Vec3f(0)}, {}, {1U << 20}};
            }),
            "/morph_targets/0/vertex_ids");
}

}  // namespace
}  // namespace gridcast::mesh
