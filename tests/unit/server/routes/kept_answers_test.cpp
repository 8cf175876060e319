#include "server/routes/kept_answers.h"

#include <thread>

#include <gtest/gtest.h>

namespace gridcast::server {
namespace {

constexpr std::chrono::duration<double, std::milli> kHour{3.6e6};

HttpResponse answer_of(std::string body) {
  return {201, "application/json", std::move(body), {}};
}

/// One whole use of a key: its answer, or nothing when it was not known before.
std::optional<std::string> use(KeptAnswers& kept, const std::string& key, const std::string& body) {
  auto entry = kept.open(key, "request");
  std::optional<std::string> known;
  if (entry->answer)
    known = entry->answer->body;
  else
    kept.keep(key, entry, answer_of(body));
  kept.close(key, std::move(entry));
  return known;
}

TEST(KeptAnswers, a_key_has_its_first_answer_and_its_first_request) {
  KeptAnswers kept(10, 1000, kHour);
  EXPECT_EQ(use(kept, "a", "one"), std::nullopt);
  EXPECT_EQ(use(kept, "a", "two"), "one");
  EXPECT_EQ(use(kept, "b", "three"), std::nullopt);
  auto entry = kept.open("a", "another request");
  EXPECT_EQ(entry->request, "request");
  kept.close("a", std::move(entry));
}

TEST(KeptAnswers, the_oldest_are_forgotten_first_by_number_and_by_bytes) {
  KeptAnswers few(2, 1000, kHour);
  for (const char* key : {"a", "b", "c"}) EXPECT_EQ(use(few, key, key), std::nullopt);
  EXPECT_EQ(use(few, "c", ""), "c");
  EXPECT_EQ(use(few, "b", ""), "b");
  EXPECT_EQ(use(few, "a", "new"), std::nullopt);

  // A key of 1 byte, a request of 7 and a body of 92.
  KeptAnswers small(10, 200, kHour);
  const std::string body(92, 'x');
  for (const char* key : {"a", "b", "c"}) EXPECT_EQ(use(small, key, body), std::nullopt);
  EXPECT_EQ(use(small, "c", ""), body);
  EXPECT_EQ(use(small, "b", ""), body);
  EXPECT_EQ(use(small, "a", ""), std::nullopt);
  EXPECT_EQ(use(small, "d", std::string(193, 'x')), std::nullopt) << "larger than all together may be";
  EXPECT_EQ(use(small, "d", ""), std::nullopt);
  EXPECT_EQ(use(small, "c", ""), body) << "it has pushed nobody out";
}

TEST(KeptAnswers, time_makes_them_forgotten) {
  KeptAnswers kept(10, 1000, std::chrono::duration<double, std::milli>(1.0));
  EXPECT_EQ(use(kept, "a", "one"), std::nullopt);
  std::this_thread::sleep_for(std::chrono::milliseconds(3));
  EXPECT_EQ(use(kept, "a", "two"), std::nullopt);
}

TEST(KeptAnswers, without_an_answer_a_key_lasts_as_long_as_somebody_uses_it) {
  KeptAnswers kept(10, 1000, kHour);
  auto first = kept.open("a", "request");
  auto second = kept.open("a", "another");
  EXPECT_EQ(first, second) << "they meet";
  kept.close("a", std::move(first));
  EXPECT_EQ(second->request, "request");
  kept.close("a", std::move(second));
  auto third = kept.open("a", "another");
  EXPECT_EQ(third->request, "another") << "it begins anew";
  kept.close("a", std::move(third));
}

}  // namespace
}  // namespace gridcast::server
