#include "core/scene/packet_choice.h"

#include <gtest/gtest.h>

namespace gridcast::scene {
namespace {

/// Groups of sixteen rays of which each takes `alone` steps for itself, and a packet of all `together`.
/// Returns how many of `count` groups went as packets.
int packets_among(PacketChoice& choice, int count, std::uint64_t together, std::uint64_t alone) {
  int packets = 0;
  for (int i = 0; i < count; ++i) {
    if (choice.packets()) {
      ++packets;
      choice.add({.together = 16, .together_steps = together});
    } else {
      choice.add({.alone = 16, .alone_steps = 16 * alone});
    }
  }
  return packets;
}

TEST(PacketChoice, packets_go_on_where_they_take_fewer_steps_and_only_try_where_not) {
  PacketChoice few_steps, many_steps;
  EXPECT_EQ(packets_among(few_steps, 6400, 40, 6), 6300) << "one in 64 goes alone to compare";
  EXPECT_EQ(packets_among(many_steps, 6400, 60, 6), 100) << "one in 64 tries";
}

TEST(PacketChoice, it_follows_rays_that_change) {
  PacketChoice choice;
  packets_among(choice, 640, 20, 6);
  packets_among(choice, 640, 200, 6);
  EXPECT_EQ(packets_among(choice, 640, 200, 6), 10);
  packets_among(choice, 640, 20, 6);
  EXPECT_EQ(packets_among(choice, 640, 20, 6), 630);
}

TEST(PacketChoice, it_tries_packets_where_none_forms_or_nothing_is_known_of_single_rays) {
  PacketChoice choice;
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(choice.packets(), i % 64 != 1);
    choice.add({.alone = 16, .alone_steps = 100});
  }
  PacketChoice uncounted;
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(uncounted.packets(), i % 64 != 1);
    uncounted.add(i % 64 == 1 ? GroupVisits{.alone = 16}
                              : GroupVisits{.together = 16, .together_steps = 900});
  }
}

}  // namespace
}  // namespace gridcast::scene
