// Rigs that bend a mesh until nothing is left of it.

#include "core/mesh/deform.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/scene/update.h"
#include "tests/stability/subject.h"
#include "tests/support/deform_reference.h"

namespace gridcast::stability {
namespace {

using mesh::MeshDeformation;

/// Weights that sum to what they like, to nothing at all, or to one; four of three joints.
MeshDeformation rig_of(const mesh::TriangleMesh& mesh, test::Random& random) {
  MeshDeformation rig;
  rig.influences = 4;
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const std::uint32_t kind = random.below(4);
    for (int k = 0; k < 4; ++k) {
      rig.joints.push_back(std::uint16_t(random.below(3)));
      rig.weights.push_back(kind == 0   ? 0.F
                            : kind == 1 ? 0.25F
                                        : float(random.uniform(0.0, kind == 2 ? 3.0 : 1e-6)));
    }
  }
  return rig;
}

/// Half a turn around y: the candy wrapper; nothing, a plane or a line left; mirrored; far away.
Affine joint_of(std::uint32_t kind, test::Random& random) {
  switch (kind) {
    case 0:
      return {Mat3d(-1, 0, 0, 0, 1, 0, 0, 0, -1), Vec3d(0.0)};
    case 1:
      return {Mat3d(0.0), random.in_box(2.0)};
    case 2:
      return {Mat3d(1, 0, 0, 0, 0, 0, 0, 0, 1), random.in_box(2.0)};
    case 3:
      return {Mat3d(1, 0, 0, 1, 0, 0, 1, 0, 0), random.in_box(2.0)};
    case 4:
      return {Mat3d(-1.0), random.in_box(1e6)};
    default:
      return {Mat3d(random.uniform(0.5, 2.0)), random.in_box(1.0)};
  }
}

// Every vertex is where wide arithmetic puts it within the stated bound; the scene that gets them is sound
// and answers like one that is built of them; a matrix that is not a number is refused before anything
// changes.
TEST(Stability, RC38_Skinning) {
  Row row(38, 6000);
  const MeshSource source = generated("jittered_icosphere 2 38");
  const auto scene = scene::build_scene(scene_data(placed(source))).value();
  row.blocks(row.rays(50), [&](test::Random& random, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      const MeshDeformation rig = rig_of(*source.mesh, random);
      ASSERT_TRUE(mesh::validate(rig, source.mesh->positions.size()).ok());
      std::vector<Affine> joints;
      for (int k = 0; k < 3; ++k) joints.push_back(joint_of(random.below(6), random));
      const auto deformed = mesh::deform(*source.mesh, rig, {}, joints);
      for (std::size_t v = 0; v < deformed.positions.size(); ++v) {
        const auto exact = test::reference_position(*source.mesh, rig, {}, joints, v);
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const long double got = deformed.positions[v][int(axis)], want = exact.position[axis];
          if (!(std::abs(got - want) <= 0x1p-24L * std::abs(want) + 32 * 0x1p-53L * exact.magnitude[axis]))
            row.fail("a vertex is not where its joints put it");
        }
      }
      const auto updated = scene::apply_update(
          *scene, {scene::ReplaceVertices{0, deformed.positions, {}, scene::UpdateMode::kRefit}});
      ASSERT_TRUE(updated.ok()) << updated.error().message;
      if (!updated->scene->validate().ok()) row.fail("a refitted skin is not sound");
      mesh::TriangleMesh moved = *source.mesh;
      moved.positions = deformed.positions;
      const SceneSpec spec = placed(given(std::move(moved)));
      const auto rebuilt = scene::build_scene(scene_data(spec)).value();
      for (int k = 0; k < 50; ++k) {
        const Vec3d target(deformed.positions[random.below(std::uint32_t(deformed.positions.size()))]);
        const Ray ray{random.in_box(4.0), target - random.in_box(4.0)};
        if (!same_bits(scene::intersect(*updated->scene, ray), scene::intersect(*rebuilt, ray)))
          row.fail(spec, {ray, {}, {}}, "a refitted skin answers otherwise than a rebuilt one");
      }
      row.count(50, 100);

      joints[0].linear[1][1] = i % 2 == 0 ? std::nan("") : std::numeric_limits<double>::infinity();
      MeshDeformation first = rig;
      std::fill(first.joints.begin(), first.joints.end(), std::uint16_t(0));
      const auto broken = mesh::deform(*source.mesh, first, {}, joints);
      const auto refused = scene::apply_update(*scene, {scene::ReplaceVertices{0, broken.positions, {}}});
      if (refused.ok()) row.fail("a skin that is not a number is accepted");
    }
  });
}

}  // namespace
}  // namespace gridcast::stability
