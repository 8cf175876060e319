#include "core/math/chunked_vector.h"

#include <gtest/gtest.h>

namespace gridcast {
namespace {

using Vector = ChunkedVector<int, 4>;

Vector counting(std::size_t size) {
  Vector vector;
  for (std::size_t i = 0; i < size; ++i) vector.push_back(int(i));
  return vector;
}

TEST(ChunkedVector, writing_copies_the_chunk_of_the_element_alone) {
  const Vector before = counting(12);
  Vector after = before;
  after.write(5) = 50;
  EXPECT_EQ(before[5], 5);
  EXPECT_EQ(after[5], 50);
  EXPECT_EQ(after[4], 4);
  EXPECT_TRUE(after.shares_chunk(before, 0));
  EXPECT_FALSE(after.shares_chunk(before, 4));
  EXPECT_TRUE(after.shares_chunk(before, 11));
}

TEST(ChunkedVector, overwriting_a_chunk_leaves_that_of_others_alone) {
  const Vector before = counting(12);
  Vector after = before;
  after.overwrite_chunk(6);
  for (std::size_t i = 4; i < 8; ++i) after.write(i) = -1;
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_EQ(before[i], int(i));
    EXPECT_EQ(after[i], i / 4 == 1 ? -1 : int(i));
  }
  // What is this vector's own already is written in place.
  after.overwrite_chunk(4);
  EXPECT_EQ(after[7], -1);
}

}  // namespace
}  // namespace gridcast
