#include "core/io/gltf_instances.h"

#include <array>
#include <string>

#include "core/io/gltf_transform.h"

namespace gridcast::io {
namespace {

void add_instance(ImportContext& context, const PlacedNode& node, const Affine& world,
                  scene::SceneData& out) {
  if (out.instances.size() >= context.options.limits.instances)
    refuse(ErrorCode::kLimitExceeded, "the scene has too many instances", pointer("nodes", node.file_index));
  if (!is_finite(world))
    refuse_invalid("an instance transform is not finite", pointer("nodes", node.file_index));
  scene::InstanceData& instance = out.instances.emplace_back();
  instance.name = node.source.name;
  instance.mesh_id = std::uint32_t(node.source.mesh);
  instance.world_from_object = world;
  instance.node = node.place;
}

/// One attribute of EXT_mesh_gpu_instancing: `count` elements, or none when the file does not have it.
std::vector<float> read_attribute(ImportContext& context, const tinygltf::Value& attributes, const char* name,
                                  std::size_t components, std::size_t count, const std::string& where) {
  if (!attributes.Has(name)) return {};
  const int accessor = attributes.Get(name).GetNumberAsInt();
  if (context.storage.count(accessor) != count)
    refuse_invalid("the instancing attributes have different counts", where);
  return context.storage.floats(accessor, components);
}

void add_gpu_instances(ImportContext& context, const PlacedNode& node, const tinygltf::Value& attributes,
                       scene::SceneData& out) {
  const std::string where = pointer("nodes", node.file_index) + "/extensions/EXT_mesh_gpu_instancing";
  std::size_t count = 0;
  bool any = false;
  for (const std::string& name : attributes.Keys()) {
    count = context.storage.count(attributes.Get(name).GetNumberAsInt());
    any = true;
  }
  if (!any) {
    context.warnings.add(where + ": no attributes, so no instances");
    return;
  }
  if (count > context.options.limits.instances - out.instances.size())
    refuse(ErrorCode::kLimitExceeded, "the scene has too many instances", where);
  const auto translations = read_attribute(context, attributes, "TRANSLATION", 3, count, where);
  const auto rotations = read_attribute(context, attributes, "ROTATION", 4, count, where);
  const auto scales = read_attribute(context, attributes, "SCALE", 3, count, where);
  context.storage.budget().take(count, sizeof(scene::InstanceData) + sizeof(Affine), where);
  out.instances.reserve(out.instances.size() + count);
  const auto vector = [](const std::vector<float>& values, std::size_t i, double otherwise) {
    return values.empty() ? Vec3d(otherwise) : Vec3d(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
  };
  for (std::size_t i = 0; i < count; ++i) {
    std::array<double, 4> rotation{0.0, 0.0, 0.0, 1.0};
    if (!rotations.empty())
      for (std::size_t c = 0; c < 4; ++c) rotation[c] = double(rotations[4 * i + c]);
    const Affine local = affine_from_trs({vector(translations, i, 0.0), rotation, vector(scales, i, 1.0)});
    add_instance(context, node, node.world * local, out);
    out.instances.back().entry = std::uint32_t(out.entries.size());
    out.entries.push_back(local);
  }
}

}  // namespace

void add_instances(ImportContext& context, const PlacedNode& node, scene::SceneData& out) {
  if (node.source.mesh < 0) return;
  const auto gpu = node.source.extensions.find("EXT_mesh_gpu_instancing");
  if (gpu != node.source.extensions.end() && gpu->second.Has("attributes")) {
    if (node.source.skin >= 0)
      context.warnings.add(pointer("nodes", node.file_index) +
                           ": a mesh that EXT_mesh_gpu_instancing places is not skinned");
    add_gpu_instances(context, node, gpu->second.Get("attributes"), out);
    return;
  }
  if (node.source.skin < 0 && glm::determinant(node.world.linear) == 0.0)
    context.warnings.add(pointer("nodes", node.file_index) +
                         ": the transform is singular, so nothing of it is hit");
  add_instance(context, node, node.world, out);
  if (node.source.skin >= 0) out.instances.back().skin_id = std::uint32_t(node.source.skin);
}

void add_camera(ImportContext& context, const PlacedNode& node, scene::SceneData& out) {
  if (node.source.camera < 0) return;
  const tinygltf::Camera& source = context.storage.model().cameras[std::size_t(node.source.camera)];
  scene::Camera camera;
  camera.name = source.name.empty() ? node.source.name : source.name;
  camera.world_from_camera = rigid_part(node.world);
  if (source.type == "perspective") {
    camera.yfov_rad = source.perspective.yfov;
    if (source.perspective.aspectRatio > 0.0) camera.aspect_ratio = source.perspective.aspectRatio;
    camera.znear = source.perspective.znear;
    if (source.perspective.zfar > 0.0) camera.zfar = source.perspective.zfar;
  } else {
    camera.kind = scene::CameraKind::kOrthographic;
    camera.xmag = source.orthographic.xmag;
    camera.ymag = source.orthographic.ymag;
    camera.znear = source.orthographic.znear;
    camera.zfar = source.orthographic.zfar;
  }
  const bool seeing = camera.kind == scene::CameraKind::kPerspective
                          ? camera.yfov_rad > 0.0 && camera.yfov_rad < 3.14159
                          : camera.xmag != 0.0 && camera.ymag != 0.0;
  if (!seeing) {
    context.warnings.add(pointer("cameras", std::size_t(node.source.camera)) +
                         ": a camera that sees nothing is skipped");
    return;
  }
  out.cameras.push_back(std::move(camera));
}

void add_light(ImportContext& context, const PlacedNode& node, scene::SceneData& out) {
  const auto extension = node.source.extensions.find("KHR_lights_punctual");
  if (extension == node.source.extensions.end()) return;
  const tinygltf::Light& source =
      context.storage.model().lights[std::size_t(extension->second.Get("light").GetNumberAsInt())];
  scene::Light light;
  light.name = source.name.empty() ? node.source.name : source.name;
  if (source.type == "point") light.kind = scene::LightKind::kPoint;
  if (source.type == "spot") light.kind = scene::LightKind::kSpot;
  if (source.color.size() == 3)
    for (std::size_t c = 0; c < 3; ++c) light.color[c] = float(source.color[c]);
  light.intensity = source.intensity;
  if (source.range > 0.0) light.range = source.range;
  if (light.kind == scene::LightKind::kSpot) {
    light.inner_cone_rad = source.spot.innerConeAngle;
    light.outer_cone_rad = source.spot.outerConeAngle;
  }
  const Affine place = rigid_part(node.world);
  light.position = place.translation;
  light.direction = -place.linear[2];
  out.lights.push_back(std::move(light));
}

}  // namespace gridcast::io
