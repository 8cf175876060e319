#pragma once
// One row of the table of failure modes: its rays, its seed, its failures, and what is kept of them.

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tests/stability/scene_spec.h"
#include "tests/support/random.h"

namespace gridcast::stability {

/// Of the command line; see main.cpp.
struct SuiteOptions {
  std::optional<std::size_t> rays;  ///< for each row, in place of its own number
  std::string ledger;               ///< file that gets a line of JSON for each row; empty = none
  std::string corpus;               ///< folder of failing cases
};
[[nodiscard]] SuiteOptions& options();

/// From now on SIGINT and SIGTERM end the program after the block of rays that is being shot, its ledger
/// written.
void end_when_told();
[[nodiscard]] bool told_to_end();

/// A test of one row makes one of these first. When it goes, the test fails if anything was reported, failing
/// rays are saved to the corpus, and the ledger gets its line; where the program was told to end, it does
/// then.
class Row {
 public:
  /// Stands for the replay of the corpus, which has no row of its own and saves nothing anew.
  static constexpr int kCorpus = 0;

  /// `number` of the row, and about how many rays it shoots in CI. Prints the seed.
  Row(int number, std::size_t standard_rays);
  ~Row();
  Row(const Row&) = delete;
  Row& operator=(const Row&) = delete;

  [[nodiscard]] std::uint64_t seed() const { return seed_; }
  /// The share of one of `parts` equal parts of the row's rays, at least one.
  [[nodiscard]] std::size_t rays(std::size_t parts = 1) const {
    return std::max<std::size_t>(1, rays_ / parts);
  }
  /// Calls shoot(random, count) for blocks of at most 2,048 rays, `total` in all. The numbers of a block
  /// depend on the seed, on how many blocks came before in this row, and on nothing else.
  template <class Shoot>
  void blocks(std::size_t total, const Shoot& shoot) {
    for (std::size_t done = 0; done < total;) {
      const std::size_t count = std::min<std::size_t>(2048, total - done);
      test::Random random(seed_ * 0x9E3779B97F4A7C15U + block_++);
      shoot(random, count);
      done += count;
      if (told_to_end()) return;
      tell_progress();
    }
  }

  /// Different rays, and how often any of them was asked of a structure.
  void count(std::size_t rays, std::size_t questions) {
    shot_ += rays;
    questions_ += questions;
  }
  /// A ray that got what it must not get. `scene` is what it was shot at.
  void fail(const SceneSpec& scene, const Shot& shot, const std::string& what);
  /// A failure without a ray: a box that does not hold its vertex, a cell that was not visited.
  void fail(const std::string& what);
  [[nodiscard]] std::size_t failures() const { return failures_; }

 private:
  void save(const SceneSpec& scene, const Shot& shot, const std::string& what) const;
  void write_ledger() const;
  /// Of long runs, now and then.
  void tell_progress();

  std::string name_;
  std::uint64_t seed_;
  std::size_t rays_;
  std::uint64_t block_ = 0;
  std::size_t shot_ = 0;
  std::size_t questions_ = 0;
  std::size_t failures_ = 0;
  std::chrono::steady_clock::time_point told_ = std::chrono::steady_clock::now();
  std::vector<std::string> messages_;  ///< of the first failures
};

}  // namespace gridcast::stability
