// Compares digests of all answers with those pinned in digests.txt: see --help.

#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <string_view>

#include "core/math/instruction_set.h"
#include "core/math/precision_names.h"
#include "tests/digests/questions.h"

namespace gridcast::digests {
namespace {

constexpr const char* kHelp =
    R"(Asks many questions of scenes in every structure of ours and compares digests of all bits of the answers with
those pinned in a file: they are the same whatever the structure, the instruction set, the compiler and its level of
optimisation.

  --pinned FILE  what to compare with, default tests/digests/digests.txt
  --print        writes such a file to stdout in place of comparing; fails when two structures disagree
  --sets         lists the instruction sets of this machine; the environment variable GRIDCAST_ISA limits to one
  --help         this
)";

constexpr const char* kHeader =
    "# Digests of the engine's answers: INPUT QUESTION PRECISION DIGEST. Written by\n"
    "#     build/ci/bin/digests --print > tests/digests/digests.txt\n"
    "# A change of these lines is a change of answers: the commit that makes it says why.\n";

struct Structure {
  std::string_view name;
  blas::BuildOptions options;
};
/// All but Embree's, whose code is not ours.
const Structure kStructures[] = {
    {"brute_force", {.kind = blas::StructureKind::kBruteForce}},
    {"bvh", {.kind = blas::StructureKind::kBvh}},
    {"wide_bvh", {.kind = blas::StructureKind::kWideBvh}},
    {"wide_bvh in Morton order",
     {.kind = blas::StructureKind::kWideBvh, .quality = blas::BuildQuality::kFast}},
    {"compact_bvh", {.kind = blas::StructureKind::kCompactBvh}},
    {"kd_tree", {.kind = blas::StructureKind::kKdTree}}};

/// "INPUT QUESTION PRECISION" and hexadecimal digits.
using Digests = std::map<std::string, std::string>;

Digests answers_of(const Structure& structure, const Input& input) {
  scene::SceneBuildOptions options;
  options.blas = structure.options;
  const auto scene = scene::build_scene(input.data, options).value();
  Digests digests;
  for (const Question& question : all_questions()) {
    for (const Precision precision : question.precisions) {
      Digest digest;
      question.ask(*scene, input, precision, digest);
      std::ostringstream key, digits;
      key << input.name << ' ' << question.name << ' ' << to_string(precision);
      digits << std::hex << std::setw(16) << std::setfill('0') << digest.value();
      digests[key.str()] = digits.str();
    }
  }
  return digests;
}

/// Says on stderr where `got` is not as `wanted`, and how often that is.
std::size_t compare(std::string_view who, const Digests& got, std::string_view other, const Digests& wanted) {
  std::size_t different = 0;
  Digests all = got;
  all.insert(wanted.begin(), wanted.end());
  for (const auto& [key, unused] : all) {
    const auto digest = [&, &key = key](const Digests& digests) {
      const auto entry = digests.find(key);
      return entry == digests.end() ? "nothing" : entry->second;
    };
    if (digest(got) == digest(wanted)) continue;
    ++different;
    std::cerr << key << ": " << who << " says " << digest(got) << ", " << other << ' ' << digest(wanted)
              << '\n';
  }
  return different;
}

/// The answers of the first structure; the others are compared with it.
Digests all_answers(std::size_t& different) {
  Digests all;
  for (const Input& input : all_inputs()) {
    const Digests first = answers_of(kStructures[0], input);
    for (const Structure& structure : std::span(kStructures).subspan(1))
      different += compare(structure.name, answers_of(structure, input), kStructures[0].name, first);
    all.insert(first.begin(), first.end());
  }
  return all;
}

Digests read(std::istream& file) {
  Digests digests;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line.front() == '#') continue;
    const std::size_t end = line.rfind(' ');
    digests[line.substr(0, end)] = line.substr(end + 1);
  }
  return digests;
}

int print() {
  std::size_t different = 0;
  const Digests digests = all_answers(different);
  std::cout << kHeader;
  for (const auto& [key, digest] : digests) std::cout << key << ' ' << digest << '\n';
  return different == 0 ? 0 : 1;
}

int check(const std::string& path) {
  std::ifstream file(path);
  if (!file) {
    std::cerr << "cannot read " << path << '\n';
    return 2;
  }
  std::size_t different = 0;
  const Digests digests = all_answers(different);
  different += compare("this build", digests, path, read(file));
  std::cout << digests.size() << " digests of " << std::size(kStructures)
            << " structures with instruction set " << instruction_set() << ": " << different << " differ\n";
  return different == 0 ? 0 : 1;
}

int run(std::span<char*> arguments) {
  std::string pinned = GRIDCAST_DIGESTS;
  bool printing = false;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string_view argument = arguments[i];
    if (argument == "--help" || argument == "-h") {
      std::cout << kHelp;
      return 0;
    }
    if (argument == "--sets") {
      for (const std::string_view set : instruction_sets()) std::cout << set << '\n';
      return 0;
    }
    if (argument == "--print") {
      printing = true;
    } else if (argument == "--pinned" && i + 1 < arguments.size()) {
      pinned = arguments[++i];
    } else {
      std::cerr << "unknown option '" << argument << "' or a value is missing (see --help)\n";
      return 2;
    }
  }
  if (const Status limited = limit_instruction_set_by_environment(); !limited) {
    std::cerr << limited.error().where << ": " << limited.error().message << '\n';
    return 2;
  }
  return printing ? print() : check(pinned);
}

}  // namespace
}  // namespace gridcast::digests

int main(int argc, char** argv) {
  return gridcast::digests::run(std::span(argv + 1, std::size_t(argc - 1)));
}
