#include "core/math/shared_vector.h"

#include <gtest/gtest.h>

namespace gridcast {
namespace {

TEST(SharedVector, copies_share_until_one_changes) {
  SharedVector<int> a{1, 2, 3};
  const SharedVector<int> b = a;
  EXPECT_TRUE(a.shares_with(b));
  a[1] = 7;
  EXPECT_FALSE(a.shares_with(b));
  EXPECT_EQ(a, (SharedVector<int>{1, 7, 3}));
  EXPECT_EQ(b, (SharedVector<int>{1, 2, 3}));
}

TEST(SharedVector, every_way_to_change_leaves_copies_alone) {
  const SharedVector<int> before{4, 5, 6};
  SharedVector<int> pushed = before, popped = before, resized = before, cleared = before, iterated = before,
                    written = before, last = before;
  pushed.push_back(7);
  popped.pop_back();
  resized.resize(1);
  cleared.clear();
  for (int& value : iterated) value = 0;
  written.data()[0] = 9;
  last.back() = 8;
  EXPECT_EQ(before, (SharedVector<int>{4, 5, 6}));
  EXPECT_EQ(pushed, (SharedVector<int>{4, 5, 6, 7}));
  EXPECT_EQ(popped, (SharedVector<int>{4, 5}));
  EXPECT_EQ(resized, (SharedVector<int>{4}));
  EXPECT_TRUE(cleared.empty());
  EXPECT_EQ(iterated, (SharedVector<int>{0, 0, 0}));
  EXPECT_EQ(written, (SharedVector<int>{9, 5, 6}));
  EXPECT_EQ(last, (SharedVector<int>{4, 5, 8}));
}

TEST(SharedVector, a_vector_that_is_moved_from_is_empty) {
  SharedVector<int> from{1, 2};
  SharedVector<int> to = std::move(from);
  from = {};
  EXPECT_TRUE(from.empty());
  from.push_back(3);
  EXPECT_EQ(to, (SharedVector<int>{1, 2}));
  to = std::move(from);
  EXPECT_EQ(to, (SharedVector<int>{3}));
}

TEST(SharedVector, an_owner_alone_changes_in_place) {
  SharedVector<int> a{1, 2, 3};
  const int* const place = std::as_const(a).data();
  a[0] = 5;
  EXPECT_EQ(std::as_const(a).data(), place);
  { const SharedVector<int> copy = a; }
  a[0] = 6;
  EXPECT_EQ(std::as_const(a).data(), place);
}

TEST(SharedVector, empty_ones_are_equal_and_can_be_filled) {
  SharedVector<int> a, b;
  EXPECT_EQ(a, b);
  EXPECT_EQ(a.begin(), a.end());
  a.reserve(4);
  a.push_back(1);
  EXPECT_NE(a, b);
  EXPECT_EQ(a.size(), 1U);
}

}  // namespace
}  // namespace gridcast
