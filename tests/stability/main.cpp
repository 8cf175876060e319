// The stability suite's own flags beside those of GoogleTest.

#include <cstdlib>
#include <iostream>
#include <string_view>

#include <gtest/gtest.h>

#include "core/math/instruction_set.h"
#include "tests/stability/row.h"

namespace {

constexpr const char* kHelp =
    R"(One test for each row of the table of failure modes (tests/stability/README.md): Stability.RC01_... to RC44_...

  --rays N       about N rays for each row in place of its own number: 1e9 for a long run, which tells its progress
                 and ends after a block of rays when it is interrupted, the ledger written; long.sh runs them
  --ledger FILE  appends a line of JSON for each row: row, rays, questions, failures, seed, upper_bound
                 (3 / rays where nothing failed: the rate is below that with 95 % confidence)
  --seed N       the seed of every row, as the environment variable GRIDCAST_SEED does
  --isa NAME     limits the instruction set, as the environment variable GRIDCAST_ISA does
  --corpus DIR   where failing rays are saved and cases replayed from, default tests/stability/corpus
  --help         this, and GoogleTest's own flags, of which --gtest_filter='*RC05*' is the most useful

)";

/// Reads `--name VALUE` at argv[i]; exits with 2 when the value is missing.
bool takes(std::string_view name, int argc, char** argv, int& i, std::string_view& value) {
  if (argv[i] != name) return false;
  if (++i == argc) {
    std::cerr << name << " needs a value (see --help)\n";
    std::exit(2);
  }
  value = argv[i];
  return true;
}

std::size_t ray_count(std::string_view text) {
  char* end = nullptr;
  const double value = std::strtod(text.data(), &end);
  if (end != text.data() + text.size() || !(value >= 1.0 && value <= 1e15)) {
    std::cerr << "--rays: '" << text << "' is not a number from 1 to 1e15\n";
    std::exit(2);
  }
  return std::size_t(value);
}

}  // namespace

int main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i)
    if (std::string_view(argv[i]) == "--help" || std::string_view(argv[i]) == "-h") std::cout << kHelp;
  testing::InitGoogleTest(&argc, argv);
  gridcast::stability::SuiteOptions& options = gridcast::stability::options();
  for (int i = 1; i < argc; ++i) {
    std::string_view value;
    if (takes("--rays", argc, argv, i, value)) {
      options.rays = ray_count(value);
    } else if (takes("--ledger", argc, argv, i, value)) {
      options.ledger = value;
    } else if (takes("--corpus", argc, argv, i, value)) {
      options.corpus = value;
    } else if (takes("--seed", argc, argv, i, value)) {
      setenv("GRIDCAST_SEED", std::string(value).c_str(), 1);
    } else if (takes("--isa", argc, argv, i, value)) {
      setenv("GRIDCAST_ISA", std::string(value).c_str(), 1);
    } else {
      std::cerr << "unknown option '" << argv[i] << "' (see --help)\n";
      return 2;
    }
  }
  if (const gridcast::Status limited = gridcast::limit_instruction_set_by_environment(); !limited) {
    std::cerr << limited.error().where << ": " << limited.error().message << '\n';
    return 2;
  }
  std::cout << "instruction set " << gridcast::instruction_set() << '\n';
  gridcast::stability::end_when_told();
  return RUN_ALL_TESTS();
}
