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
  packets_among(few_steps, 120, 40, 6);
  packets_among(many_steps, 120, 60, 6);
  EXPECT_EQ(packets_among(few_steps, 6400, 40, 6), 6300) << "one in 64 goes alone to compare";
  EXPECT_EQ(packets_among(many_steps, 6400, 60, 6), 100) << "one in 64 tries";
}

TEST(PacketChoice, the_first_comparisons_come_soon) {
  PacketChoice choice;
  EXPECT_EQ(packets_among(choice, 120, 500, 6), 4) << "after 8, 16, 32 and 64 groups";
}

TEST(PacketChoice, it_follows_rays_that_change) {
  PacketChoice choice;
  packets_among(choice, 6400, 20, 6);
  packets_among(choice, 6400, 200, 6);
  EXPECT_EQ(packets_among(choice, 640, 200, 6), 10);
  packets_among(choice, 12800, 20, 6);
  EXPECT_EQ(packets_among(choice, 640, 20, 6), 630);
}

// A camera's rays that pass the mesh take a step or two, whichever way they go.
TEST(PacketChoice, rays_that_meet_nothing_count_little) {
  PacketChoice choice;
  int packets = 0;
  for (int stretch = 0; stretch < 40; ++stretch) {
    packets_among(choice, 320, 2, 1);
    packets += packets_among(choice, 320, 200, 6);
  }
  EXPECT_LT(packets, 12800 / 20);
}

TEST(PacketChoice, it_tries_packets_where_none_forms_or_nothing_is_known_of_single_rays) {
  PacketChoice none_forms, uncounted;
  int alone_asked = 0, alone_uncounted = 0;
  for (int i = 0; i < 6400; ++i) {
    alone_asked += none_forms.packets() ? 0 : 1;
    none_forms.add({.alone = 16, .alone_steps = 100});
    const bool packets = uncounted.packets();
    alone_uncounted += packets ? 0 : 1;
    uncounted.add(packets ? GroupVisits{.together = 16, .together_steps = 900} : GroupVisits{.alone = 16});
  }
  EXPECT_LT(alone_asked, 110);
  EXPECT_LT(alone_uncounted, 110);
}

}  // namespace
}  // namespace gridcast::scene
