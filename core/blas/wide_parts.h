#pragma once
// A wide tree cut into parts that are worked on one by one.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/blas/wide_bvh.h"

namespace gridcast::blas {

/// A subtree of at most kMaxPartNodes nodes, or one node above such subtrees.
struct WidePart {
  std::uint32_t begin, end;  ///< its nodes, contiguous
  bool subtree;
};

/// Subtrees of at most this many nodes are one thread's: about ten microseconds of a refit, and their boxes
/// stay in the first cache.
inline constexpr std::size_t kMaxPartNodes = 64;

/// The parts of a tree, parents before children. They depend on the links alone, so every refit of a tree has
/// the same.
struct WideParts {
  WideParts() = default;
  explicit WideParts(const WideNodes& nodes);

  std::vector<WidePart> all;
  std::vector<std::uint32_t> subtrees;  ///< those of `all` that are
  /// A node above: its place in `all`, and the places of its inner children, slot by slot.
  struct Above {
    std::uint32_t part;
    std::array<std::uint32_t, 8> children;
  };
  std::vector<Above> above;

  /// The part of a node.
  [[nodiscard]] std::size_t part_of(std::uint32_t node) const;

 private:
  void add(const WideNodes& nodes, std::size_t self, std::size_t end);
};

}  // namespace gridcast::blas
