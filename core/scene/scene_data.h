#pragma once
// What a file holds, as plain structs: the input of build_scene and the output of importers.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/math/trs.h"
#include "core/mesh/deformation.h"
#include "core/mesh/triangle_mesh.h"
#include "core/scene/shared_text.h"

namespace gridcast::scene {

/// Metallic-roughness material, linear colours. Textures are not kept.
struct Material {
  std::string name;
  std::array<float, 4> base_color{1.F, 1.F, 1.F, 1.F};
  std::array<float, 3> emissive{0.F, 0.F, 0.F};  ///< includes KHR_materials_emissive_strength
  float metallic = 1.F;
  float roughness = 1.F;
  float transmission = 0.F;  ///< KHR_materials_transmission
  float ior = 1.5F;          ///< KHR_materials_ior
  bool double_sided = false;
  bool unlit = false;
};

enum class LightKind : std::uint8_t { kDirectional, kPoint, kSpot };

/// KHR_lights_punctual; position and direction are in world space.
struct Light {
  std::string name;
  LightKind kind = LightKind::kDirectional;
  std::array<float, 3> color{1.F, 1.F, 1.F};
  double intensity = 1.0;  ///< lux for directional, candela for point and spot
  std::optional<double> range;
  double inner_cone_rad = 0.0;
  double outer_cone_rad = 0.78539816339744830962;
  Vec3d position{0.0};
  Vec3d direction{0.0, 0.0, -1.0};  ///< unit, the way the light shines
};

enum class CameraKind : std::uint8_t { kPerspective, kOrthographic };

/// A glTF camera: looks along its local -z, +y up.
struct Camera {
  std::string name;
  CameraKind kind = CameraKind::kPerspective;
  double yfov_rad = 0.8;               ///< perspective
  std::optional<double> aspect_ratio;  ///< perspective; none = the picture's
  double xmag = 1.0, ymag = 1.0;       ///< orthographic half sizes
  double znear = 0.0;
  std::optional<double> zfar;
  Affine world_from_camera;  ///< rigid: scale removed
};

/// A node of the file's hierarchy, kept for posing: parents come before children.
struct Node {
  std::string name;
  std::uint32_t parent = kInvalidId;      ///< index into SceneData::nodes
  Affine local;                           ///< parent_from_node at rest
  Trs trs;                                ///< the same, as animations change it part by part
  std::uint32_t file_index = kInvalidId;  ///< the node's index in the file
  std::uint32_t mesh_id = kInvalidId;
  std::uint32_t skin_id = kInvalidId;
  std::vector<float> weights;  ///< morph weights that override the mesh's
};

struct Skin {
  std::string name;
  std::vector<std::uint32_t> joints;  ///< indices into SceneData::nodes
  std::vector<Affine> inverse_bind;   ///< one per joint
  std::uint32_t skeleton = kInvalidId;
};

using mesh::MeshDeformation;
using mesh::MorphTarget;

enum class Interpolation : std::uint8_t { kStep, kLinear, kCubicSpline };
enum class AnimationPath : std::uint8_t { kTranslation, kRotation, kScale, kWeights };

struct AnimationChannel {
  std::uint32_t node = kInvalidId;  ///< index into SceneData::nodes
  AnimationPath path = AnimationPath::kTranslation;
  Interpolation interpolation = Interpolation::kLinear;
  std::vector<float> times_s;
  std::vector<float> values;  ///< [keys (x3 for cubic spline), components]
};

struct Animation {
  std::string name;
  std::vector<AnimationChannel> channels;
};

/// One placed mesh: a glTF node with a mesh, or one entry of EXT_mesh_gpu_instancing.
/// instance_id is its index in SceneData::instances: by node index, then by entry.
struct InstanceData {
  SharedText name;
  Affine world_from_object;
  std::uint32_t mesh_id = kInvalidId;
  std::uint32_t node = kInvalidId;  ///< index into SceneData::nodes; none = not part of any pose
  std::uint32_t skin_id = kInvalidId;
  std::uint32_t entry = kInvalidId;  ///< index into SceneData::entries; none = stands where its node does
};
static_assert(sizeof(InstanceData) == sizeof(SharedText) + sizeof(Affine) + 16,
              "a scene has many: no padding");

struct SceneData {
  std::string name;
  std::vector<std::shared_ptr<const mesh::TriangleMesh>>
      meshes;                                 ///< mesh_id = the file's mesh index; never null
  std::vector<MeshDeformation> deformations;  ///< one per mesh
  std::vector<InstanceData> instances;
  std::vector<Affine> entries;  ///< node_from_object of instances that EXT_mesh_gpu_instancing placed
  std::vector<Material> materials;
  std::vector<Camera> cameras;
  std::vector<Light> lights;
  std::vector<Node> nodes;
  std::vector<Skin> skins;
  std::vector<Animation> animations;
  std::vector<std::string> warnings;  ///< what was skipped or changed, one sentence each
};

}  // namespace gridcast::scene
