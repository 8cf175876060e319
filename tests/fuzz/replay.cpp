// Drives a fuzz target where libFuzzer is not there: every file of its corpus, then damaged copies of them.
// What is shot depends on the seed alone.

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>

#include <unistd.h>

#include "tests/fuzz/fuzz_input.h"
#include "tests/support/random.h"

namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<Bytes> read_corpus(const std::string& folder) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::vector<Bytes> corpus;
  for (const auto& path : paths) corpus.push_back(read_file(path));
  return corpus;
}

/// One to five edits: a byte changed, a piece cut, doubled, or taken from another file.
Bytes damage(Bytes bytes, const std::vector<Bytes>& corpus, gridcast::test::Random& random) {
  static const std::uint8_t odd[] = {0x00, 0x01, 0x7F, 0x80, 0xFF, '"', '[', '{'};
  for (std::uint32_t edits = 1 + random.below(5); edits > 0 && !bytes.empty(); --edits) {
    const std::size_t at = random.below(std::uint32_t(bytes.size()));
    const std::size_t end = std::min(bytes.size(), at + 1 + random.below(16));
    const auto from = bytes.begin() + std::ptrdiff_t(at), to = bytes.begin() + std::ptrdiff_t(end);
    const std::uint32_t kind = random.below(6);
    if (kind == 0) bytes[at] = std::uint8_t(random.below(256));
    if (kind == 1) bytes[at] = odd[random.below(std::size(odd))];
    if (kind == 2) bytes[at] ^= std::uint8_t(1U << random.below(8));
    if (kind == 3) bytes.erase(from, to);
    if (kind == 4) {
      const Bytes piece(from, to);
      bytes.insert(from, piece.begin(), piece.end());
    }
    if (kind == 5) {
      const Bytes& other = corpus[random.below(std::uint32_t(corpus.size()))];
      if (other.size() <= at) continue;
      const std::size_t length = std::min(other.size() - at, end - at);
      std::copy_n(other.begin() + std::ptrdiff_t(at), length, from);
    }
  }
  return bytes;
}

/// What aborts is left behind as a file, to be looked at and kept.
void run(const Bytes& bytes) {
  std::ofstream("last_fuzz_input", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: " << argv[0] << " CORPUS_FOLDER DAMAGED_COPIES\n";
    return 2;
  }
  const std::vector<Bytes> corpus = read_corpus(argv[1]);
  if (corpus.empty()) {
    std::cerr << argv[1] << " is empty\n";
    return 1;
  }
  const auto scratch =
      std::filesystem::temp_directory_path() / ("gridcast_fuzz_" + std::to_string(::getpid()));
  std::filesystem::create_directories(scratch);
  std::filesystem::current_path(scratch);
  for (const Bytes& bytes : corpus) run(bytes);
  gridcast::test::Random random(gridcast::test::seed_or(7001));
  const int copies = std::stoi(argv[2]);
  for (int i = 0; i < copies; ++i)
    run(damage(corpus[random.below(std::uint32_t(corpus.size()))], corpus, random));
  std::cout << corpus.size() << " files, " << copies << " damaged copies\n";
  std::filesystem::current_path("/");
  std::filesystem::remove_all(scratch);
  return 0;
}
