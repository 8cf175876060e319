#pragma once
// A jointed figure of one closed body per bone, skinned softly where bones meet.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/mesh/deformation.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::measure {

struct FigureJoint {
  std::string_view name;
  std::uint32_t parent;  ///< index into kFigureJoints, kInvalidId for the first
  Vec3d place;           ///< at rest, metres, y up, feet at 0
  Vec3d end;             ///< of its bone
  double radius;         ///< of its bone
};

inline constexpr std::array kFigureJoints{
    FigureJoint{"hips", kInvalidId, {0.0, 0.95, 0.0}, {0.0, 1.25, 0.0}, 0.16},
    FigureJoint{"chest", 0, {0.0, 1.22, 0.0}, {0.0, 1.55, 0.0}, 0.18},
    FigureJoint{"head", 1, {0.0, 1.55, 0.0}, {0.0, 1.82, 0.0}, 0.11},
    FigureJoint{"left upper arm", 1, {0.17, 1.45, 0.0}, {0.48, 1.45, 0.0}, 0.055},
    FigureJoint{"left forearm", 3, {0.46, 1.45, 0.0}, {0.80, 1.45, 0.0}, 0.045},
    FigureJoint{"right upper arm", 1, {-0.17, 1.45, 0.0}, {-0.48, 1.45, 0.0}, 0.055},
    FigureJoint{"right forearm", 5, {-0.46, 1.45, 0.0}, {-0.80, 1.45, 0.0}, 0.045},
    FigureJoint{"left thigh", 0, {0.1, 0.95, 0.0}, {0.1, 0.48, 0.0}, 0.09},
    FigureJoint{"left shin", 7, {0.1, 0.5, 0.0}, {0.1, 0.0, 0.0}, 0.065},
    FigureJoint{"right thigh", 0, {-0.1, 0.95, 0.0}, {-0.1, 0.48, 0.0}, 0.09},
    FigureJoint{"right shin", 9, {-0.1, 0.5, 0.0}, {-0.1, 0.0, 0.0}, 0.065}};

struct Figure {
  mesh::TriangleMesh mesh;            ///< at rest, with normals
  mesh::MeshDeformation deformation;  ///< joints are indices into kFigureJoints
};

/// About `triangles` triangles; `girth` scales the radii.
[[nodiscard]] Figure make_figure(std::size_t triangles, double girth);

}  // namespace gridcast::measure
