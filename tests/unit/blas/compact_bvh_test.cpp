#include "core/blas/compact_bvh.h"

#include <cstring>

#include <gtest/gtest.h>
#include <oneapi/tbb/task_arena.h>

#include "core/blas/compact_layout.h"
#include "core/blas/kernel_steps.h"
#include "core/math/instruction_set.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::blas {
namespace {

using mesh::TriangleMesh;
using test::Random;

std::shared_ptr<const CompactBvh> built(const TriangleMesh& mesh) {
  return CompactBvh::build(mesh, {.spatial = SpatialSplits::kNever}, {}).value();
}

template <class T>
bool same_bytes(const T& a, const T& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0;
}
bool same_bits(const CompactBvh& a, const CompactBvh& b) {
  return same_bytes(a.nodes(), b.nodes()) && same_bytes(a.ids(), b.ids());
}

/// One to eight boxes of a size around an offset, some of them flat, some points.
std::vector<Bounds3f> random_boxes(Random& random, float offset, float size) {
  std::vector<Bounds3f> boxes(1 + random.below(8));
  for (Bounds3f& box : boxes) {
    box.extend(Vec3f(random.in_box(double(size))) + offset);
    if (random.below(5) != 0) box.extend(Vec3f(random.in_box(double(size))) + offset);
    if (const std::uint32_t axis = random.below(6); axis < 3) box.upper[int(axis)] = box.lower[int(axis)];
  }
  return boxes;
}

struct Placement {
  float offset, size;
};
constexpr Placement kPlacements[] = {{0.F, 1.F},  {0.F, 1e-30F}, {0.F, 1e-42F},  {0.F, 1e18F},
                                     {1e6F, 1.F}, {1e6F, 0.1F},  {-1e6F, 1e-3F}, {3.F, 1e-7F},
                                     {-0.F, 0.F}, {7.F, 0.F},    {1e18F, 1e17F}, {-1e-38F, 1e-38F}};

TEST(CompactNode, decoded_boxes_contain_the_boxes_and_no_smaller_ones_do) {
  Random random(test::seed_or(61));
  for (const auto& [offset, size] : kPlacements) {
    SCOPED_TRACE(testing::Message() << offset << " +- " << size);
    for (int i = 0; i < 500; ++i) {
      const std::vector<Bounds3f> boxes = random_boxes(random, offset, size);
      CompactNode node{};
      node.set_boxes(boxes);
      for (std::uint32_t slot = 0; slot < boxes.size(); ++slot) {
        ASSERT_TRUE(node.box(slot).contains(boxes[slot]));
        for (int axis = 0; axis < 3; ++axis) {
          CompactNode tighter = node;
          ++tighter.planes[0][axis][slot];
          --tighter.planes[1][axis][slot];
          if (node.planes[0][axis][slot] < 255) {
            ASSERT_GE(tighter.plane(0, axis, slot), boxes[slot].lower[axis]);
          }
          if (node.planes[1][axis][slot] > 0) {
            ASSERT_LE(tighter.plane(1, axis, slot), boxes[slot].upper[axis]);
          }
        }
      }
    }
  }
}

TEST(CompactNode, steps_are_the_smallest_that_reach_across_the_node) {
  Random random(test::seed_or(62));
  for (int i = 0; i < 2000; ++i) {
    const std::vector<Bounds3f> boxes = random_boxes(random, 0.5F, 1.F);
    Bounds3f all;
    for (const Bounds3f& box : boxes) all.extend(box);
    CompactNode node{};
    node.set_boxes(boxes);
    for (int axis = 0; axis < 3; ++axis) {
      if (all.lower[axis] == all.upper[axis]) continue;
      EXPECT_LT(double(node.origin[axis]) + 127.5 * double(node.step(axis)), double(all.upper[axis]) + 1e-6);
    }
  }
  const std::vector<Bounds3f> exact{{Vec3f(1.F), Vec3f(256.F)}};
  CompactNode node{};
  node.set_boxes(exact);
  EXPECT_EQ(node.step(0), 1.F) << "255 steps of one";
  EXPECT_EQ(node.box(0), exact[0]);
}

TEST(CompactNode, zeros_of_either_sign_give_the_same_bits) {
  CompactNode minus{}, plus{};
  minus.set_boxes(std::vector<Bounds3f>{{Vec3f(-0.F), Vec3f(1.F)}, {Vec3f(-0.F), Vec3f(-0.F)}});
  plus.set_boxes(std::vector<Bounds3f>{{Vec3f(0.F), Vec3f(1.F)}, {Vec3f(0.F), Vec3f(0.F)}});
  EXPECT_EQ(std::memcmp(&minus, &plus, sizeof plus), 0);
}

TEST(CompactNode, links_tell_inner_children_and_leaves_apart) {
  CompactNode node{};
  node.counts = 2 | (5 << 4);
  node.first_child = 700;
  node.first_id = compact_child::kIndexMask - 20;
  const std::uint8_t ends[8] = {0, 0, 8, 9, 17, 0, 0, 0};
  std::copy(std::begin(ends), std::end(ends), node.ends);
  EXPECT_EQ(compact_child::of(node, 0), 700U);
  EXPECT_EQ(compact_child::of(node, 1), 701U);
  const std::uint32_t counts[] = {8, 1, 8}, starts[] = {0, 8, 9};
  for (std::uint32_t leaf = 0; leaf < 3; ++leaf) {
    const std::uint32_t link = compact_child::of(node, 2 + leaf);
    EXPECT_TRUE(wide_child::is_leaf(link));
    EXPECT_EQ(compact_child::count(link), counts[leaf]);
    EXPECT_EQ(compact_child::first_id(link), node.first_id + starts[leaf]);
  }
  EXPECT_EQ(used_slots(node), 0x1FU);
}

/// Whether rays enter the slots of a node as they enter the same boxes as floats, bit for bit.
void expect_entered_alike(const CompactNode& node, const Bounds3f& bounds, Random& random) {
  WideNode wide{};
  wide.slots = node.slot_count();
  for (std::uint32_t slot = 0; slot < 8; ++slot) wide.set_box(slot, Bounds3f{});
  for (std::uint32_t slot = 0; slot < wide.slots; ++slot) wide.set_box(slot, node.box(slot));
  const Bounds3d box = to_double(bounds);
  for (int i = 0; i < 20; ++i) {
    const Vec3d target = box.center() + 0.5 * box.extent() * random.in_box(1.0);
    const Vec3d origin = box.center() + 2.0 * max_abs(box.extent()) * random.in_box(1.0);
    if (target == origin) continue;
    mesh::ObjectRay ray;
    if (!ray.prepare({origin, target - origin}, bounds)) continue;
    SlotEntries compact, floats;
    const std::uint32_t hits = enter_node(node, ray, ray.cull_far(3.0), compact);
    ASSERT_EQ(hits, enter_node(wide, ray, ray.cull_far(3.0), floats));
    for (std::uint32_t slot = 0; slot < wide.slots; ++slot)
      ASSERT_EQ(compact.s_enter_bits[slot], floats.s_enter_bits[slot]);
  }
}

TEST(CompactNode, kernels_decode_the_same_bits_in_every_instruction_set) {
  const std::string before(instruction_set());
  for (const std::string_view set : instruction_sets()) {
    SCOPED_TRACE(set);
    ASSERT_TRUE(limit_instruction_set(set));
    Random random(test::seed_or(63));
    for (const auto& [offset, size] : {Placement{0.F, 1.F}, {1e6F, 1.F}, {-3.F, 1e-4F}, {0.F, 1e-30F}}) {
      for (int i = 0; i < 100; ++i) {
        const std::vector<Bounds3f> boxes = random_boxes(random, offset, size);
        Bounds3f all;
        for (const Bounds3f& box : boxes) all.extend(box);
        CompactNode node{};
        node.counts = std::uint8_t(boxes.size() << 4U);
        node.set_boxes(boxes);
        // Planes of unused slots mean nothing.
        for (auto& side : node.planes)
          for (auto& axis : side) std::fill(axis + boxes.size(), axis + 8, std::uint8_t(random.below(256)));
        expect_entered_alike(node, all, random);
      }
    }
  }
  ASSERT_TRUE(limit_instruction_set(before));
}

TEST(CompactBvh, every_tree_is_valid_from_no_triangle_to_many) {
  for (const int triangles : {0, 1, 2, 3, 4, 5, 8, 9, 16, 17, 63, 64, 65, 1000, 20000}) {
    const TriangleMesh mesh = test::soup(triangles, 3);
    const Status status = built(mesh)->validate(mesh);
    EXPECT_TRUE(status.ok()) << triangles << ": " << status.error().where << " " << status.error().message;
  }
  for (const TriangleMesh& mesh : {test::repeated(test::single_triangle(), 5000), test::needle_fan(1000),
                                   test::slivers(2000, 4, 1e4F), test::quad_grid(40)}) {
    EXPECT_TRUE(built(mesh)->validate(mesh).ok());
    EXPECT_TRUE(CompactBvh::build(mesh, {}, {}).value()->validate(mesh).ok()) << "leaves may share triangles";
  }
}

TEST(CompactBvh, moving_one_vertex_out_of_the_box_is_caught_and_then_healed) {
  const TriangleMesh mesh = test::jittered_icosphere(3, 1);
  const auto bvh = built(mesh);
  ASSERT_TRUE(bvh->validate(mesh).ok());
  TriangleMesh changed = mesh;
  changed.positions[77] *= 3.F;
  const Status caught = bvh->validate(changed);
  ASSERT_FALSE(caught.ok());
  EXPECT_EQ(caught.error().where.substr(0, 7), "/nodes/");
  EXPECT_TRUE(bvh->refit(changed).value()->validate(changed).ok());
  EXPECT_TRUE(bvh->validate(mesh).ok()) << "the old tree must stay as it was";
}

TEST(CompactBvh, a_refit_is_the_refitted_wide_tree_written_smaller) {
  TriangleMesh mesh = test::soup(20000, test::seed_or(44));
  mesh.positions[0] = {-0.F, 0.F, -0.F};
  mesh.positions[1] = {0.F, -0.F, 0.F};
  const auto first = built(mesh);
  const auto wide = WideBvh::build(mesh, {.spatial = SpatialSplits::kNever}, {}).value();
  const TriangleMesh far = test::translated(mesh, Vec3f(3.F, -1.F, 2.F));
  const auto away = first->refit(far).value();
  EXPECT_FALSE(same_bits(*first, *away));
  const auto wanted = compacted(*wide->refit(far).value()).value();
  EXPECT_TRUE(same_bytes(away->nodes(), wanted.nodes));
  EXPECT_TRUE(same_bytes(away->ids(), wanted.ids));
  EXPECT_TRUE(same_bits(*first, *away->refit(mesh).value())) << "the first positions give the first bits";
}

TEST(CompactBvh, the_tree_does_not_depend_on_the_number_of_threads) {
  const TriangleMesh mesh = test::soup(30000, 9);
  const TriangleMesh moved = test::translated(mesh, Vec3f(0.3F));
  std::shared_ptr<const CompactBvh> one, four;
  oneapi::tbb::task_arena(1).execute([&] { one = built(mesh); });
  oneapi::tbb::task_arena(4).execute([&] { four = built(mesh); });
  EXPECT_TRUE(same_bits(*one, *four));
  oneapi::tbb::task_arena(1).execute([&] { one = one->refit(moved).value(); });
  oneapi::tbb::task_arena(4).execute([&] { four = four->refit(moved).value(); });
  EXPECT_TRUE(same_bits(*one, *four));
}

TEST(CompactBvh, it_takes_a_sixth_of_the_wide_trees_memory_and_40_bytes_a_triangle_with_its_mesh) {
  const TriangleMesh mesh = test::icosphere(5);
  StructureStats compact, wide;
  built(mesh)->add_stats(compact);
  WideBvh::build(mesh, {.spatial = SpatialSplits::kNever}, {}).value()->add_stats(wide);
  EXPECT_EQ(compact.node_count, wide.node_count);
  EXPECT_EQ(compact.leaf_count, wide.leaf_count);
  EXPECT_EQ(compact.reference_count, wide.reference_count);
  EXPECT_EQ(compact.max_depth, wide.max_depth);
  EXPECT_GE(compact.cost, wide.cost);
  EXPECT_LT(compact.cost, 1.1 * wide.cost);
  EXPECT_LT(6 * compact.memory_bytes, wide.memory_bytes);
  EXPECT_LT(double(compact.memory_bytes + mesh.memory_bytes()), 40.0 * double(mesh.triangle_count()));
}

TEST(CompactBvh, auto_never_takes_it) {
  for (const TriangleMesh& mesh : {test::icosphere(4), test::soup(3000, 5), test::slivers(3000, 4, 1000.F)})
    EXPECT_NE(Blas::build(test::share(mesh), {}).value().stats().kind, StructureKind::kCompactBvh);
}

}  // namespace
}  // namespace gridcast::blas
