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
  for (int& element : after.overwrite_chunk(6)) element = -1;
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_EQ(before[i], int(i));
    EXPECT_EQ(after[i], i / 4 == 1 ? -1 : int(i));
  }
  // What is this vector's own already is written in place.
  EXPECT_EQ(after.overwrite_chunk(4)[3], -1);
  EXPECT_EQ(after[7], -1);
}

TEST(ChunkedVector, a_chunk_is_all_of_its_elements_and_written_through_a_copy_of_its_own) {
  const Vector before = counting(10);
  Vector after = before;
  EXPECT_EQ(&before.chunk(6)[1], &before[5]);
  after.write_chunk(6)[1] = 50;
  EXPECT_EQ(before[5], 5);
  EXPECT_EQ(after[5], 50);
  EXPECT_EQ(after[4], 4);
  EXPECT_EQ(after.write_chunk(5).data(), &after[4]) << "in place from then on";
  EXPECT_EQ(after.chunk(9).size(), 4U);
}

}  // namespace
}  // namespace gridcast
