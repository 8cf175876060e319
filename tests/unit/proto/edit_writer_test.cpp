// Edits that are written are read back bit for bit: shown on random ones of every kind, and on numbers that
// are hard to write.

#include "proto/edit_writer.h"

#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "proto/update_log.h"
#include "proto/vocabulary.h"
#include "tests/unit/proto/problem_matcher.h"

namespace gridcast::proto {
namespace {

constexpr int kRounds = 200;

// The templates below use all of these.
bool same(const Affine& a, const Affine& b);
bool same(const std::array<double, 4>& a, const std::array<double, 4>& b);
bool same(const PoseNode& a, const PoseNode& b);
bool same(const PoseSkin& a, const PoseSkin& b);
bool same(const PoseWeights& a, const PoseWeights& b);
bool same(const PoseAnimation& a, const PoseAnimation& b);

bool same(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}
bool same(float a, float b) {
  return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}
bool same(std::uint32_t a, std::uint32_t b) {
  return a == b;
}
template <glm::length_t kLength, class T>
bool same(const glm::vec<kLength, T>& a, const glm::vec<kLength, T>& b) {
  for (glm::length_t i = 0; i < kLength; ++i)
    if (!same(a[i], b[i])) return false;
  return true;
}
bool same(const Affine& a, const Affine& b) {
  return same(a.linear[0], b.linear[0]) && same(a.linear[1], b.linear[1]) && same(a.linear[2], b.linear[2]) &&
         same(a.translation, b.translation);
}
template <class List>
bool same_list(const List& a, const List& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](const auto& x, const auto& y) { return same(x, y); });
}
bool same(const std::array<double, 4>& a, const std::array<double, 4>& b) {
  return same_list(a, b);
}
template <class T>
bool same(const std::optional<T>& a, const std::optional<T>& b) {
  return a.has_value() == b.has_value() && (!a || same(*a, *b));
}
bool same(const PoseNode& a, const PoseNode& b) {
  return a.node == b.node && same(a.transform, b.transform) && same(a.translation, b.translation) &&
         same(a.rotation, b.rotation) && same(a.scale, b.scale);
}
bool same(const PoseSkin& a, const PoseSkin& b) {
  return a.skin == b.skin && same_list(a.joint_matrices, b.joint_matrices);
}
bool same(const PoseWeights& a, const PoseWeights& b) {
  return a.mesh_id == b.mesh_id && same_list(a.weights, b.weights);
}
bool same(const PoseAnimation& a, const PoseAnimation& b) {
  return a.animation == b.animation && same(a.time_s, b.time_s) && a.wrap == b.wrap;
}

bool same(const AddInstanceRequest& a, const AddInstanceRequest& b) {
  return a.mesh_id == b.mesh_id && same(a.world_from_object, b.world_from_object) && a.name == b.name &&
         a.mask == b.mask;
}
bool same(const InstanceMove& a, const InstanceMove& b) {
  return a.instance_id == b.instance_id && same(a.world_from_object, b.world_from_object);
}
bool same(const InstanceChange& a, const InstanceChange& b) {
  return a.instance_id == b.instance_id && same(a.change.world_from_object, b.change.world_from_object) &&
         a.change.mask == b.change.mask && a.change.name == b.change.name;
}
bool same(const RemoveInstanceRequest& a, const RemoveInstanceRequest& b) {
  return a.instance_id == b.instance_id;
}
bool same(const MeshVerticesRequest& a, const MeshVerticesRequest& b) {
  return a.mesh_id == b.mesh_id && a.vertices.update == b.vertices.update &&
         same_list(a.vertices.positions, b.vertices.positions) &&
         same_list(a.vertices.vertex_ids, b.vertices.vertex_ids);
}
bool same(const PoseEditRequest& a, const PoseEditRequest& b) {
  return a.op == b.op && a.pose.base == b.pose.base && a.pose.update == b.pose.update &&
         same(a.pose.animation, b.pose.animation) && same_list(a.pose.nodes, b.pose.nodes) &&
         same_list(a.pose.skins, b.pose.skins) && same_list(a.pose.weights, b.pose.weights);
}
bool same_edit(const TransactionEdit& a, const TransactionEdit& b) {
  return a.index() == b.index() &&
         std::visit([&](const auto& edit) { return same(edit, std::get<std::decay_t<decltype(edit)>>(b)); },
                    a);
}

/// Random edits, of any bits that the wire can hold.
class Edits {
 public:
  explicit Edits(unsigned seed) : random_(seed) {}

  TransactionEdit any() {
    switch (up_to(6)) {
      case 0:
        return AddInstanceRequest{id(), affine(), name(), mask()};
      case 1:
        return InstanceMove{id(), affine()};
      case 2:
        return RemoveInstanceRequest{id()};
      case 3:
        return vertices();
      case 4:
        return PoseEditRequest{"set_weights", weights_alone()};
      case 5:
        return change();
      default:
        return PoseEditRequest{"set_pose", pose()};
    }
  }

 private:
  std::uint32_t up_to(std::uint32_t most) { return std::uint32_t(random_() % (most + 1ULL)); }
  std::uint32_t id() { return up_to(kInvalidId - 1); }
  template <class T, class Bits>
  T finite() {
    while (true) {
      const auto value = std::bit_cast<T>(Bits(random_()));
      if (std::isfinite(value)) return value;
    }
  }
  double number() { return finite<double, std::uint64_t>(); }
  float single() { return finite<float, std::uint32_t>(); }
  Vec3d vector() { return {number(), number(), number()}; }
  Affine affine() { return {{vector(), vector(), vector()}, vector()}; }
  std::string name() {
    constexpr std::array<std::string_view, 6> kNames{"",          "links",      "a \"b\" \\ c",
                                                     "\xC3\xBC/", "</script>'", "\xF0\x9F\xA6\x8A"};
    return std::string(kNames[up_to(kNames.size() - 1)]);
  }
  InstanceMask mask() { return InstanceMask(up_to(kFullMask)); }
  /// With one member at least.
  InstanceChange change() {
    InstanceChange edit{id(), {}};
    const std::uint32_t members = 1 + up_to(6);
    if ((members & 1U) != 0) edit.change.world_from_object = affine();
    if ((members & 2U) != 0) edit.change.mask = mask();
    if ((members & 4U) != 0) edit.change.name = name();
    return edit;
  }
  FileElement element() { return up_to(1) == 0 ? FileElement(id()) : FileElement(name()); }
  template <class Make>
  auto list(Make make) {
    std::vector<decltype(make())> values(up_to(3));
    for (auto& value : values) value = make();
    return values;
  }
  std::string update() { return std::string(kUpdateModeNames[up_to(2)]); }

  MeshVerticesRequest vertices() {
    MeshVerticesRequest edit{id(), {}};
    edit.vertices.positions.resize(1 + up_to(3));
    for (Vec3f& p : edit.vertices.positions) p = {single(), single(), single()};
    if (up_to(1) == 0)
      for (std::size_t i = 0; i < edit.vertices.positions.size(); ++i)
        edit.vertices.vertex_ids.push_back(id());
    edit.vertices.update = update();
    return edit;
  }
  PoseWeights weights() {
    return {id(), list([this] { return number(); })};
  }
  PoseRequest weights_alone() {
    PoseRequest pose;
    pose.base = "present";
    pose.weights = {weights()};
    pose.update = update();
    return pose;
  }
  PoseNode node() {
    PoseNode node{element(), {}, {}, {}, {}};
    if (up_to(1) == 0) {
      node.transform = affine();
      return node;
    }
    if (up_to(1) == 0) node.translation = vector();
    if (up_to(1) == 0) node.rotation = std::array{number(), number(), number(), number()};
    if (up_to(1) == 0) node.scale = vector();
    return node;
  }
  PoseRequest pose() {
    PoseRequest pose;
    pose.base = kPoseBaseNames[up_to(1)];
    pose.update = update();
    if (up_to(1) == 0) pose.animation = PoseAnimation{element(), number(), std::string(kWrapNames[up_to(1)])};
    pose.nodes = list([this] { return node(); });
    pose.skins = list([this] { return PoseSkin{element(), list([this] { return affine(); })}; });
    pose.weights = list([this] { return weights(); });
    return pose;
  }

  std::mt19937_64 random_;
};

std::string written(const std::vector<TransactionEdit>& edits) {
  JsonText text(0);
  const char* before = "{\"edits\":[";
  for (const TransactionEdit& edit : edits) {
    text.raw(before);
    write_edit(text, edit);
    before = ",";
  }
  text.raw("]}");
  return std::move(text).take();
}

/// Whether `edits` survive being written and read.
::testing::AssertionResult come_back(const std::vector<TransactionEdit>& edits) {
  const std::string text = written(edits);
  const auto read = parse_transaction(text, Limits{});
  if (!read) return ::testing::AssertionFailure() << outcome(read) << ": " << text;
  if (read->size() != edits.size()) return ::testing::AssertionFailure() << "lost some: " << text;
  for (std::size_t i = 0; i < edits.size(); ++i)
    if (!same_edit(edits[i], read.value()[i])) return ::testing::AssertionFailure() << i << ": " << text;
  return ::testing::AssertionSuccess();
}

TEST(EditWriter, random_edits_come_back_bit_for_bit) {
  Edits random(20261130);
  std::array<int, 6> kinds{};
  for (int round = 0; round < kRounds; ++round) {
    std::vector<TransactionEdit> edits(10);
    for (TransactionEdit& edit : edits) {
      edit = random.any();
      ++kinds[edit.index()];
    }
    ASSERT_TRUE(come_back(edits)) << "round " << round;
  }
  for (const int count : kinds) EXPECT_GT(count, kRounds) << "every kind was there";
}

TEST(EditWriter, a_difference_would_be_noticed) {
  const InstanceMove move{3, {}};
  InstanceMove other = move;
  other.world_from_object.translation.y = -0.0;
  EXPECT_TRUE(same_edit(move, move));
  EXPECT_FALSE(same_edit(move, other));
  EXPECT_FALSE(same_edit(move, AddInstanceRequest{}));
}

TEST(EditWriter, floats_that_would_be_rounded_twice_keep_their_bits) {
  // The shortest digits of the first, read as a double and narrowed, are its neighbour.
  MeshVerticesRequest edit{0, {}};
  edit.vertices.positions = {{7.038531e-26F, -7.038531e-26F, -0.F},
                             {0x1p-149F, std::numeric_limits<float>::max(), 0x1p53F},
                             {0.1F, 1e10F, 16777217.F}};
  ASSERT_NE(float(7.038531e-26), 7.038531e-26F) << "or it would show nothing";
  EXPECT_TRUE(come_back({edit}));
}

TEST(EditWriter, doubles_keep_their_bits) {
  InstanceMove edit;
  edit.instance_id = 0;
  // 2^64 is written without an exponent, which as an integer would be refused.
  edit.world_from_object.linear[0] = {0x1p64, -0x1p63, 0x1p53 + 2};
  edit.world_from_object.linear[1] = {5e-324, std::numeric_limits<double>::max(), -0.0};
  edit.world_from_object.linear[2] = {0.1, 1.0 / 3.0, 123456789012345680000.0};
  edit.world_from_object.translation = {1e22, 9007199254740993.0, 2.2250738585072011e-308};
  EXPECT_TRUE(come_back({edit}));
}

TEST(EditWriter, defaults_are_left_out) {
  EXPECT_EQ(written({RemoveInstanceRequest{7}, PoseEditRequest{"set_pose", {}}}),
            R"({"edits":[{"op":"remove_instance","instance_id":7},{"op":"set_pose"}]})");
  EXPECT_EQ(written({AddInstanceRequest{2, {}, "", kFullMask}}),
            R"({"edits":[{"op":"add_instance","mesh_id":2,"transform":[[1,0,0,0],[0,1,0,0],[0,0,1,0]]}]})");
}

TEST(LogWriter, lines_hold_a_version_and_what_transactions_take) {
  LogWriter log;
  log.begin(7);
  log.add(RemoveInstanceRequest{1});
  log.add(RemoveInstanceRequest{2});
  log.end();
  log.begin(8);
  log.end();
  EXPECT_EQ(std::move(log).take(),
            "{\"version\":7,\"edits\":[{\"op\":\"remove_instance\",\"instance_id\":1},"
            "{\"op\":\"remove_instance\",\"instance_id\":2}]}\n"
            "{\"version\":8,\"edits\":[{\"op\":\"set_pose\",\"base\":\"present\"}]}\n");
  EXPECT_EQ(outcome(parse_transaction(R"({"edits":[{"op":"set_pose","base":"present"}]})", Limits{})), "ok");
}

TEST(LogQuery, asks_from_a_version_on) {
  Limits limits;
  limits.log_lines = 50;
  const auto query = parse_log_query({{"since", "18446744073709551615"}, {"limit", "7"}}, limits);
  ASSERT_EQ(outcome(query), "ok");
  EXPECT_EQ(query.value().since, std::numeric_limits<std::uint64_t>::max());
  EXPECT_EQ(query.value().limit, 7U);
  EXPECT_EQ(parse_log_query({{"since", "1"}}, limits).value().limit, 50U);
  EXPECT_EQ(outcome(parse_log_query({}, limits)), "missing_field 422 ?since");
  EXPECT_EQ(outcome(parse_log_query({{"since", "0"}}, limits)), "out_of_range 422 ?since");
  EXPECT_EQ(outcome(parse_log_query({{"since", "-1"}}, limits)), "out_of_range 422 ?since");
  EXPECT_EQ(outcome(parse_log_query({{"since", "18446744073709551616"}}, limits)), "out_of_range 422 ?since");
  EXPECT_EQ(outcome(parse_log_query({{"since", "1"}, {"limit", "51"}}, limits)), "out_of_range 422 ?limit");
  EXPECT_EQ(outcome(parse_log_query({{"since", "1"}, {"limit", "0"}}, limits)), "out_of_range 422 ?limit");
  EXPECT_EQ(outcome(parse_log_query({{"since", "1"}, {"since", "2"}}, limits)), "invalid_value 422 ?since");
  EXPECT_EQ(outcome(parse_log_query({{"since", "1"}, {"at_version", "1"}}, limits)),
            "unknown_parameter 422 ?at_version");
}

TEST(AtVersion, is_a_version_or_nothing) {
  EXPECT_EQ(parse_at_version({{"name", "x"}}).value(), std::nullopt);
  EXPECT_EQ(parse_at_version({{"name", "x"}, {"at_version", "7"}}).value(), 7U);
  for (const char* text : {"", "0", "-1", "1.0", " 1", "1e3", "18446744073709551616", "newest"})
    EXPECT_EQ(outcome(parse_at_version({{"at_version", text}})), "out_of_range 422 ?at_version") << text;
}

}  // namespace
}  // namespace gridcast::proto
