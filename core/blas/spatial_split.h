#pragma once
// Dividing a set of triangles at a plane in space: triangles across it get a reference on either side.
// "Spatial Splits in Bounding Volume Hierarchies", M. Stich, 2009.

#include <array>
#include <cstddef>
#include <optional>
#include <span>

#include "core/blas/bvh_split.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::blas {

/// The parts of a reference on both sides of a plane across it, either of which may be empty.
struct CutReference {
  Box4 left;
  Box4 right;
};

/// `box` contains what it stands for: the triangle within some cell. Then so do the two parts together, each
/// on its side of the plane: why is beside the code.
[[nodiscard]] CutReference cut_reference(const std::array<Vec3f, 3>& corners, const Box4& box, int axis,
                                         float plane);

/// A plane and what it costs.
struct SpatialSplit {
  int axis = 0;
  float plane = 0.F;
  float cost = 0.F;                     ///< as BinnedSplit::cost
  std::array<std::size_t, 2> counts{};  ///< about
  std::array<Box4, 2> boxes;
};

/// Two parts: `counts[0]` references at the front of the room, `counts[1]` at its end.
struct SpatialDivision {
  std::array<std::size_t, 2> counts{};
  std::array<SetBounds, 2> parts;
};

class SpatialSplitter {
 public:
  SpatialSplitter(const mesh::TriangleMesh& mesh, const AreaScale& areas, const Box4& root, LeafBlock block);

  /// Whether the parts of the best division by centers overlap so much that a plane in space may pay.
  /// `cut_above`: a set that holds this one was divided at such a plane.
  [[nodiscard]] bool promising(const BinnedSplit& split, bool cut_above) const;

  /// The cheapest of the planes between equal bins along each axis of the set's box, if it saves enough for
  /// the references that it adds. Large sets are judged by a sample.
  [[nodiscard]] std::optional<SpatialSplit> find(std::span<const BuildReference> references,
                                                 const BinnedSplit& other, const Box4& box) const;

  /// Copies the references to both ends of `room`. A triangle across the plane stays whole in one part where
  /// that is cheaper. None when the room does not suffice, or a part comes out empty.
  [[nodiscard]] std::optional<SpatialDivision> divide(std::span<const BuildReference> references,
                                                      const SpatialSplit& split,
                                                      std::span<BuildReference> room) const;

 private:
  const mesh::TriangleMesh& mesh_;
  const AreaScale& areas_;
  LeafBlock block_;
  float least_saving_;           ///< half area times blocks, for each reference more
  std::size_t least_uncut_set_;  ///< smaller ones are looked at only where a larger one was cut
};

}  // namespace gridcast::blas
