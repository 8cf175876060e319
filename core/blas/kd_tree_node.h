#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/math/bounds.h"

namespace gridcast::blas {

/// 8 bytes. An inner node holds a plane across one axis and its second child (the side above the plane); its
/// first child, the side below, follows it directly. A leaf holds a range of KdTreeData::references.
///
///      word   | inner                     | leaf
///      first  | bits of the plane (float) | first reference
///      second | second child << 2 | axis  | count << 2 | 3
class KdNode {
 public:
  static KdNode inner(int axis, float plane, std::size_t second_child) {
    return {std::bit_cast<std::uint32_t>(plane), std::uint32_t(second_child << 2) | std::uint32_t(axis)};
  }
  static KdNode leaf(std::size_t first, std::size_t count) {
    return {std::uint32_t(first), std::uint32_t(count << 2) | kLeaf};
  }

  [[nodiscard]] bool is_leaf() const { return (second_ & 3U) == kLeaf; }
  [[nodiscard]] int axis() const { return int(second_ & 3U); }
  [[nodiscard]] float plane() const { return std::bit_cast<float>(first_); }
  [[nodiscard]] std::uint32_t second_child() const { return second_ >> 2; }
  [[nodiscard]] std::uint32_t first() const { return first_; }
  [[nodiscard]] std::uint32_t count() const { return second_ >> 2; }

 private:
  static constexpr std::uint32_t kLeaf = 3;
  KdNode(std::uint32_t first, std::uint32_t second) : first_(first), second_(second) {}

  std::uint32_t first_;
  std::uint32_t second_;
};
static_assert(sizeof(KdNode) == 8);

/// A kd-tree as it is built, before kd_layout.h packs it. A node's cell is the part of `bounds` that its
/// ancestors' planes leave to it, closed on every side. Every point of a triangle lies in a leaf that lists
/// the triangle.
struct KdTreeData {
  Bounds3f bounds;
  std::vector<KdNode> nodes;  ///< nodes[0] is the root; empty for a mesh without triangles
  std::vector<std::uint32_t> references;
};

/// Child links and counts have 30 bits. The builder keeps references and leaves below
/// kMaxReferencesPerTriangle for each triangle, nodes below twice that.
inline constexpr std::size_t kMaxKdTriangles = std::size_t(1) << 26;
inline constexpr std::size_t kMaxReferencesPerTriangle = 7;
/// No leaf of the binary tree lies deeper, which bounds the stack of a traversal. The builder's own limit is
/// 8 + 1.3 log2 n ("On building fast kd-trees for ray tracing, and on doing that in O(N log N)", I. Wald,
/// 2006), which is 42 for 2^26 triangles.
inline constexpr std::size_t kMaxKdDepth = 42;

}  // namespace gridcast::blas
