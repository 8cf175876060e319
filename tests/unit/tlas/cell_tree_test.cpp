// Trees of crowded cells.

#include "core/tlas/cell_tree.h"

#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "core/tlas/cell_reader.h"
#include "tests/support/random.h"

namespace gridcast::tlas {
namespace {

constexpr Cell kCell{5, 5, 5};

/// `count` boxes in an order that is awkward to split.
std::vector<BoxRecord> make_records(int pattern, std::size_t count, test::Random& random) {
  std::vector<BoxRecord> records;
  for (std::size_t i = 0; i < count; ++i) {
    const auto k = float(i), n = float(count);
    Vec3f at(0.F);
    if (pattern == 1) at = {k, 0.F, -k};                              // in order
    if (pattern == 2) at = {n - k, 0.5F * k, 0.F};                    // backwards
    if (pattern == 3) at = {i < count / 2 ? k : n - k, 0.F, 0.F};     // up and down
    if (pattern == 4) at = {float(i % 3), float(i % 2), -0.F};        // a few places
    if (pattern == 5) at = Vec3f(std::exp2(float(i % 200) - 100.F));  // ever closer
    if (pattern == 6) at = Vec3f(random.in_box(100.0));
    const Vec3f half = Vec3f(glm::abs(random.in_box(0.1)));
    BoxRecord record{{at - half, at + half}, std::uint32_t(1000 + i), {kCell, kCell}};
    if (random.below(2) == 0) record.range.lower[random.below(3)] = 4;
    if (random.below(2) == 0) record.range.upper[random.below(3)] = 6;
    records.push_back(record);
  }
  return records;
}

TEST(CellTree, lists_every_instance_once_in_full_leaves_whatever_the_order) {
  test::Random random(test::seed_or(151));
  CellTreeBuilder builder;
  for (const std::size_t count : {33U, 64U, 65U, 100U, 513U, 4000U}) {
    for (int pattern = 0; pattern <= 6; ++pattern) {
      SCOPED_TRACE(testing::Message() << count << " of pattern " << pattern);
      const std::vector<BoxRecord> records = make_records(pattern, count, random);
      std::vector<const BoxRecord*> references;
      for (const BoxRecord& record : records) references.push_back(&record);
      std::vector<BoxGroup<8>> groups(cell_tree_size(count));
      builder.build(references, kCell, groups);
      std::set<std::uint32_t> found;
      const auto visit = [&](std::uint32_t id, const Bounds3f& box, std::uint32_t seen) {
        EXPECT_TRUE(found.insert(id).second);
        EXPECT_EQ(box, records[id - 1000].box);
        EXPECT_EQ(seen, records[id - 1000].seen_from(kCell));
      };
      const void* const bytes = groups.data();
      const CellReader reader(visit);
      EXPECT_TRUE(reader.read({static_cast<const std::byte*>(bytes), CellKind::kTree}));
      EXPECT_EQ(found.size(), count);
    }
  }
}

TEST(CellTree, a_node_parts_its_instances_at_medians_of_the_longest_axis) {
  test::Random random(test::seed_or(152));
  std::vector<BoxRecord> records;
  for (std::uint32_t i = 0; i < 64; ++i) {
    const Vec3f at(float(random.uniform(-1.0, 1.0)), float(i), 0.F);
    records.push_back({{at, at}, i, {kCell, kCell}});
  }
  std::vector<const BoxRecord*> references;
  for (const BoxRecord& record : records) references.push_back(&record);
  for (std::size_t i = references.size(); i > 1; --i)
    std::swap(references[i - 1], references[random.below(std::uint32_t(i))]);
  std::vector<BoxGroup<8>> groups(cell_tree_size(64));
  CellTreeBuilder().build(references, kCell, groups);
  ASSERT_EQ(groups.size(), 9U);
  for (std::size_t child = 0; child < 8; ++child)
    EXPECT_EQ(groups[0].box(child).extent().y, 7.F) << "eight in a row";
}

}  // namespace
}  // namespace gridcast::tlas
