// The choice of what to build anew, on a small tree made by hand.

#include "core/blas/wide_damage.h"

#include <gtest/gtest.h>

namespace gridcast::blas {
namespace {

/// The root, a node A with the subtrees B and C, and the subtree D: a hundred triangles in each subtree.
class WideDamage : public testing::Test {
 protected:
  WideDamage() {
    parts_.all = {{0, 1, false}, {1, 2, false}, {2, 12, true}, {12, 22, true}, {22, 32, true}};
    parts_.subtrees = {2, 3, 4};
    parts_.above = {{0, {1, 4}}, {1, {2, 3}}};
    below_ = sizes_below(parts_, std::vector<PartSize>{{}, {}, {1, 1, 100}, {1, 1, 100}, {1, 1, 100}});
  }
  [[nodiscard]] std::vector<WideRange> chosen(const std::vector<double>& costs) const {
    return find_damage(parts_, costs, fresh_, below_).subtrees;
  }
  WideParts parts_;
  std::vector<PartSize> below_;
  const std::vector<double> fresh_{10, 10, 100, 100, 100};
};

TEST_F(WideDamage, a_subtree_that_became_worse_is_chosen_alone) {
  EXPECT_TRUE(chosen({10, 10, 100, 100, 100}).empty());
  EXPECT_TRUE(chosen({10, 10, 100, 110, 100}).empty()) << "too little to pay";
  const auto subtrees = chosen({10, 10, 100, 300, 100});
  ASSERT_EQ(subtrees.size(), 1U);
  EXPECT_EQ(subtrees[0].begin, 12U);
  EXPECT_EQ(subtrees[0].end, 22U);
}

TEST_F(WideDamage, what_subtrees_lose_together_with_the_node_above_them_is_added_up) {
  const auto subtrees = chosen({10, 80, 180, 180, 100});
  ASSERT_EQ(subtrees.size(), 1U);
  EXPECT_EQ(subtrees[0].begin, 1U);
  EXPECT_EQ(subtrees[0].end, 22U);
  EXPECT_EQ(find_damage(parts_, std::vector<double>{10, 80, 180, 180, 100}, fresh_, below_).triangles, 200U);
}

TEST_F(WideDamage, damage_at_the_top_chooses_everything) {
  const auto subtrees = chosen({500, 10, 100, 100, 100});
  ASSERT_EQ(subtrees.size(), 1U);
  EXPECT_EQ(subtrees[0].begin, 0U);
  EXPECT_EQ(subtrees[0].end, 32U);
}

}  // namespace
}  // namespace gridcast::blas
