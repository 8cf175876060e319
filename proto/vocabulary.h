#pragma once
// Words of the wire format that core also has as enumerators. Requests carry them as strings that are
// already checked against these lists, so core's own parse functions cannot fail on them.

#include <array>
#include <string_view>

#include "core/math/precision_names.h"

namespace gridcast::proto {

inline constexpr std::array<std::string_view, 7> kStructureNames{
    "auto", "brute_force", "bvh", "wide_bvh", "compact_bvh", "kd_tree", "embree"};
/// Structures that can be named for a comparison: what "auto" would choose is one of them.
inline constexpr std::array<std::string_view, 6> kBuiltStructureNames{"brute_force", "bvh",     "wide_bvh",
                                                                      "compact_bvh", "kd_tree", "embree"};
/// How a tree is built: for the best rays, or sooner.
inline constexpr std::array<std::string_view, 2> kBuildQualityNames{"default", "fast"};
using gridcast::kPrecisionNames;
inline constexpr std::array<std::string_view, 3> kUpdateModeNames{"auto", "refit", "rebuild"};
/// What a pose begins with; what a time outside of an animation means.
inline constexpr std::array<std::string_view, 2> kPoseBaseNames{"rest", "present"};
inline constexpr std::array<std::string_view, 2> kWrapNames{"clamp", "loop"};
/// `op` of a transaction's edits.
inline constexpr std::array<std::string_view, 7> kEditNames{
    "add_instance", "move_instance", "remove_instance", "replace_vertices",
    "set_pose",     "set_weights",   "change_instance"};
inline constexpr std::array<std::string_view, 5> kSensorTypeNames{"pinhole", "fisheye", "orthographic",
                                                                  "lidar", "grid"};
inline constexpr std::array<std::string_view, 4> kIntegratorNames{"whitted", "depth", "normal", "id"};
inline constexpr std::array<std::string_view, 6> kLayerNames{"color",       "depth",   "normal",
                                                             "instance_id", "mesh_id", "primitive_id"};
inline constexpr std::array<std::string_view, 2> kImageFormatNames{"png", "exr"};
/// Classes of rays that tradeoffs are measured on.
inline constexpr std::array<std::string_view, 8> kRayClassNames{"random", "edge",     "vertex",  "grazing",
                                                                "axis",   "coherent", "diffuse", "shadow"};
/// Of the steps of an explained ray, in the order of core's enumerators: what a cell holds, what becomes of
/// an instance and of a triangle.
inline constexpr std::array<std::string_view, 3> kCellContentNames{"empty", "list", "tree"};
inline constexpr std::array<std::string_view, 7> kInstanceOutcomeNames{
    "entered", "mesh_missed", "box_missed", "beyond_best", "already_tested", "other_block", "masked"};
inline constexpr std::array<std::string_view, 5> kTriangleVerdictNames{"filtered", "missed", "hit",
                                                                       "out_of_range", "excluded"};
/// `status` and `t` are in every answer; naming them is allowed. `t_error` comes only when named.
inline constexpr std::array<std::string_view, 8> kHitFieldNames{
    "status", "t", "uv", "normal", "instance_id", "mesh_id", "primitive_id", "t_error"};

}  // namespace gridcast::proto
