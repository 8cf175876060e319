#include "tests/stability/row.h"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <sstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace gridcast::stability {
namespace {

/// Told and saved of one run of a row; the rest is only counted.
constexpr std::size_t kToldFailures = 8;
constexpr int kEndedBySignal = 130;
/// Above this a mesh without a line is not worth a file of the repository.
constexpr std::size_t kMaxSavedTriangles = 2000;

volatile std::sig_atomic_t end_asked = 0;

std::string row_name(int number) {
  if (number == Row::kCorpus) return "corpus";
  return (number < 10 ? "RC0" : "RC") + std::to_string(number);
}

}  // namespace

SuiteOptions& options() {
  static SuiteOptions all{.rays = {}, .ledger = "", .corpus = GRIDCAST_SOURCE_DIR "/tests/stability/corpus"};
  return all;
}

void end_when_told() {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { end_asked = 1; });
}

bool told_to_end() {
  return end_asked != 0;
}

Row::Row(int number, std::size_t standard_rays)
    : name_(row_name(number)),
      seed_(test::seed_or(1000 + std::uint64_t(number))),
      rays_(options().rays.value_or(standard_rays)) {}

Row::~Row() {
  std::string told;
  for (const std::string& message : messages_) told += "\n  " + message;
  EXPECT_EQ(failures_, 0U) << name_ << " failed with seed " << seed_ << ':' << told;
  std::cout << name_ << ": " << shot_ << " rays, " << questions_ << " questions, " << failures_
            << " failures";
  if (failures_ == 0 && shot_ != 0) std::cout << " (below " << 3.0 / double(shot_) << " a ray)";
  std::cout << '\n' << std::flush;
  write_ledger();
  if (told_to_end()) std::_Exit(kEndedBySignal);
}

void Row::tell_progress() {
  constexpr std::chrono::seconds kInterval{10};
  const auto now = std::chrono::steady_clock::now();
  if (!options().rays || now - told_ < kInterval) return;
  told_ = now;
  std::cout << name_ << ": " << shot_ << " rays so far, " << failures_ << " failures\n" << std::flush;
}

void Row::fail(const SceneSpec& scene, const Shot& shot, const std::string& what) {
  if (failures_ < kToldFailures && name_ != row_name(kCorpus)) save(scene, shot, what);
  fail(what);
}

void Row::fail(const std::string& what) {
  if (failures_++ < kToldFailures) messages_.push_back(what);
}

void Row::save(const SceneSpec& scene, const Shot& shot, const std::string& what) const {
  for (const MeshSource& source : scene.meshes)
    if (source.spec.empty() && source.mesh->triangle_count() > kMaxSavedTriangles) return;
  std::ostringstream text;
  write_case(text, {what, "found by " + name_ + ", seed " + std::to_string(seed_), scene, {shot}});
  // The name follows the content, so that the same case is saved once.
  const std::size_t hash = std::hash<std::string>{}(text.str());
  std::ostringstream name;
  name << name_ << '_' << std::hex << hash << ".txt";
  const std::filesystem::path file = std::filesystem::path(options().corpus) / name.str();
  std::ofstream(file) << text.str();
  std::cout << name_ << ": saved " << file << '\n';
}

void Row::write_ledger() const {
  if (options().ledger.empty()) return;
  nlohmann::ordered_json line = {
      {"row", name_}, {"rays", shot_}, {"questions", questions_}, {"failures", failures_}, {"seed", seed_}};
  // No failure in N rays: the rate is below 3 / N with 95 % confidence.
  line["upper_bound"] = failures_ == 0 && shot_ != 0 ? nlohmann::ordered_json(3.0 / double(shot_)) : nullptr;
  std::ofstream(options().ledger, std::ios::app) << line.dump() << '\n';
}

}  // namespace gridcast::stability
