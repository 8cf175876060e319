// Trees as a data folder's cache holds them: the first byte chooses a structure, the rest are words that are
// written over its bytes here and there. What is accepted is asked in every way.

#include <string>

#include "core/blas/tree_codec.h"
#include "tests/fuzz/fuzz_input.h"
#include "tests/support/lying_tree.h"

using namespace gridcast;

namespace {

struct Tree {
  std::shared_ptr<const mesh::TriangleMesh> mesh;
  std::string bytes;
};

Tree made(const blas::BuildOptions& options, mesh::TriangleMesh mesh) {
  Tree tree{test::share(std::move(mesh)), {}};
  tree.bytes = blas::encode_tree(blas::Blas::build(tree.mesh, options).value()).value();
  return tree;
}

/// One whose plan of refits is written too.
Tree refitted() {
  Tree tree = made({.kind = blas::StructureKind::kWideBvh}, test::icosphere(3));
  const auto moved = test::share(test::jittered_icosphere(3, 4));
  const auto blas = blas::decode_tree(tree.mesh, tree.bytes)->refit(moved);
  return {moved, blas::encode_tree(*blas).value()};
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Tree trees[] = {
      made({.kind = blas::StructureKind::kWideBvh}, test::icosphere(2)),
      made({.kind = blas::StructureKind::kBvh}, test::icosphere(2)),
      made({.kind = blas::StructureKind::kKdTree}, test::icosphere(2)),
      made({.kind = blas::StructureKind::kWideBvh}, test::slivers(300, 1, 1e3F)),
      made({.kind = blas::StructureKind::kKdTree}, test::slivers(300, 1, 1e3F)),
      made({.kind = blas::StructureKind::kCompactBvh}, test::icosphere(2)),
      made({.kind = blas::StructureKind::kCompactBvh}, test::slivers(300, 1, 1e3F)),
      refitted(),
  };
  fuzz::FuzzInput input(data, size);
  const Tree& tree = trees[input.below(std::size(trees))];
  std::string bytes = tree.bytes;
  while (!input.empty()) {
    const std::size_t at = input.raw<std::uint32_t>() % bytes.size();
    const auto word = input.raw<std::uint32_t>();
    const std::size_t width = std::min<std::size_t>(1 + input.below(4), bytes.size() - at);
    std::memcpy(bytes.data() + at, &word, width);
  }
  const auto decoded = blas::decode_tree(tree.mesh, bytes);
  if (decoded)
    test::use_every_way(*decoded, *tree.mesh);
  else
    fuzz::require(!decoded.error().message.empty(), "a refusal says nothing");
  return 0;
}
