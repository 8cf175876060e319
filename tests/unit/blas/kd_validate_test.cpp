#include <bit>

#include <gtest/gtest.h>

#include "core/blas/kd_tree.h"
#include "tests/support/shapes.h"

namespace gridcast::blas {
namespace {

using mesh::TriangleMesh;

class KdTreeValidate : public testing::Test {
 protected:
  const TriangleMesh mesh_ = test::icosphere(3);
  KdLayout layout_ = KdTree::build(mesh_, {}).value()->layout();

  void SetUp() override { ASSERT_TRUE(valid()); }
  [[nodiscard]] bool valid() const { return validate_kd_tree(layout_, mesh_).ok(); }

  /// A treelet in the middle that has both kinds of children, and its slots of each kind.
  KdTreelet& treelet() {
    for (std::size_t i = layout_.treelets.size() / 8; i < layout_.treelets.size(); ++i) {
      KdTreelet& found = layout_.treelets[i];
      if (found.inner != 0 && found.inner != found.used) return found;
    }
    ADD_FAILURE() << "no treelet with a leaf and a child";
    return layout_.treelets[0];
  }
  static std::uint32_t leaf_slot(const KdTreelet& t) {
    return std::uint32_t(std::countr_zero(std::uint32_t(t.used & ~t.inner)));
  }
};

TEST_F(KdTreeValidate, a_triangle_missing_from_a_leaf_is_caught) {
  for (std::size_t i = 0; i < layout_.blocks.size(); i += 7) {
    const KdBlock before = layout_.blocks[i];
    std::uint32_t& lane = layout_.blocks[i].triangles[0];
    lane = (lane + 640) % 1280;
    EXPECT_FALSE(valid()) << "block " << i;
    layout_.blocks[i] = before;
  }
}

TEST_F(KdTreeValidate, a_leaf_that_became_empty_space_is_caught) {
  KdTreelet& t = treelet();
  const std::uint32_t slot = leaf_slot(t);
  t.used = std::uint8_t(t.used & ~(1U << slot));
  EXPECT_FALSE(valid());
  t.block_counts &= ~(15U << (4 * slot));
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, a_moved_plane_is_caught) {
  for (const float shift : {-0.3F, -0.01F, 0.01F, 0.3F, 5.F}) {
    const KdTreelet before = treelet();
    KdTreelet& t = treelet();
    t.planes[0] += shift;
    EXPECT_FALSE(valid()) << shift;
    t = before;
  }
  EXPECT_TRUE(valid());
}

TEST_F(KdTreeValidate, a_wrong_half_space_is_caught) {
  KdTreelet& t = treelet();
  t.path[leaf_slot(t)] ^= 8;  // the other side of its first plane
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, a_wrong_axis_is_caught) {
  treelet().axes ^= 1;
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, a_wrong_link_is_caught) {
  ++treelet().first_treelet;
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, blocks_of_another_leaf_are_caught) {
  ++treelet().first_block;
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, an_inner_child_in_an_unused_slot_is_caught) {
  KdTreelet& t = treelet();
  t.inner = std::uint8_t(t.inner | ~t.used);
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, a_copy_out_of_range_is_caught) {
  layout_.blocks.back().triangles[3] = 5000;
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, copies_with_old_corners_another_id_or_there_twice_are_caught) {
  const KdTriangle before = layout_.triangles[9];
  layout_.triangles[9].corners[4] += 0.5F;
  EXPECT_FALSE(valid());
  layout_.triangles[9] = before;
  layout_.triangles[9].id = 7000;
  EXPECT_FALSE(valid());
  layout_.triangles[9] = layout_.triangles[8];
  EXPECT_FALSE(valid());
}

TEST_F(KdTreeValidate, moved_vertices_are_caught) {
  const TriangleMesh moved = test::icosphere(3, 1.5F);
  EXPECT_FALSE(validate_kd_tree(layout_, moved).ok());
}

TEST(KdTreeValidatePile, a_pile_that_loses_a_triangle_is_caught) {
  const TriangleMesh mesh = test::repeated(test::single_triangle(), 700);
  KdLayout layout = KdTree::build(mesh, {}).value()->layout();
  ASSERT_TRUE(validate_kd_tree(layout, mesh).ok());
  ASSERT_GT(layout.treelets.size(), 2U) << "700 equal triangles need treelets without planes";
  KdBlock& block = layout.blocks[layout.blocks.size() / 2];
  block.triangles[1] = block.triangles[2];
  EXPECT_FALSE(validate_kd_tree(layout, mesh).ok());
}

}  // namespace
}  // namespace gridcast::blas
