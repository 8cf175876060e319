#pragma once
// What a builder knows of a primitive, and of a set of them.

#include <bit>
#include <cstdint>
#include <span>

#include "core/blas/float4.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::blas {

/// The box of a primitive, or of a part of one, and the number that goes into the leaf. No coordinate is -0.
struct alignas(32) BuildReference {
  Vec3f lower;
  std::uint32_t id;
  Vec3f upper;
  std::uint32_t unused;

  /// The fourth lanes hold `id` and `unused`.
  [[nodiscard]] Box4 box() const { return std::bit_cast<Box4>(*this); }
  static BuildReference make(const Box4& box, std::uint32_t id) {
    auto made = std::bit_cast<BuildReference>(box);
    made.id = id;
    return made;
  }
};
static_assert(sizeof(BuildReference) == 32);

/// Twice the center: the order is the same, and no rounding is added by halving denormals.
inline Float4 doubled_center(const Box4& box) {
  return first_three(box.lower) + first_three(box.upper);
}

/// The boxes of a set of references, and their (doubled) centers. Minimum and maximum give the same bits in
/// any order, as no coordinate is -0.
struct SetBounds {
  Box4 boxes;
  Box4 centers;

  void extend(const BuildReference& reference) {
    const Box4 box = reference.box();
    boxes.extend(box);
    centers.extend(doubled_center(box));
  }
  void extend(const SetBounds& other) {
    boxes.extend(other.boxes);
    centers.extend(other.centers);
  }
};

[[nodiscard]] inline SetBounds bounds_of(std::span<const BuildReference> references) {
  SetBounds bounds;
  for (const BuildReference& reference : references) bounds.extend(reference);
  return bounds;
}

/// Writes a reference to every triangle of the mesh, in parallel.
SetBounds make_references(const mesh::TriangleMesh& mesh, BuildReference* references);

}  // namespace gridcast::blas
