#pragma once
// The members of everything that is kept. Each binding names all members of its type: one that is added does
// not compile before it is written here (and then a format changes).

#include "core/scene/scene_state.h"
#include "server/store/bytes.h"
#include "server/store/scene_codec.h"

namespace gridcast::server::store {

inline void fields(ByteWriter& archive, const scene::SharedText& text) {
  archive(text.str());
}
inline void fields(ByteReader& archive, scene::SharedText& text) {
  std::string read;
  archive(read);
  text = std::move(read);
}

template <>
inline constexpr int kEnumerators<blas::StructureKind> = 7;
template <>
inline constexpr int kEnumerators<blas::BvhSplit> = 3;
template <>
inline constexpr int kEnumerators<blas::SpatialSplits> = 2;
template <>
inline constexpr int kEnumerators<blas::MeshMotion> = 2;
template <>
inline constexpr int kEnumerators<blas::BuildQuality> = 2;
template <>
inline constexpr int kEnumerators<scene::LightKind> = 3;
template <>
inline constexpr int kEnumerators<scene::CameraKind> = 2;
template <>
inline constexpr int kEnumerators<scene::Interpolation> = 3;
template <>
inline constexpr int kEnumerators<scene::AnimationPath> = 4;

template <class A>
void fields(A& archive, Is<blas::BuildOptions> auto& options) {
  auto& [kind, split, spatial, motion, quality] = options;
  archive(kind, split, spatial, motion, quality);
}
template <class A>
void fields(A& archive, Is<mesh::MeshPart> auto& part) {
  auto& [first_triangle, triangle_count, material_id] = part;
  archive(first_triangle, triangle_count, material_id);
}
template <class A>
void fields(A& archive, Is<mesh::TriangleMesh> auto& mesh) {
  auto& [name, positions, triangles, normals, parts, topology_version, vertex_version] = mesh;
  archive(name, positions, triangles, normals, parts, topology_version, vertex_version);
}
template <class A>
void fields(A& archive, Is<mesh::MorphTarget> auto& target) {
  auto& [positions, normals, vertex_ids] = target;
  archive(positions, normals, vertex_ids);
}
template <class A>
void fields(A& archive, Is<mesh::MeshDeformation> auto& deformation) {
  auto& [morph_targets, default_weights, influences, joints, weights] = deformation;
  archive(morph_targets, default_weights, influences, joints, weights);
}
template <class A>
void fields(A& archive, Is<Trs> auto& trs) {
  auto& [translation, rotation, scale] = trs;
  archive(translation, rotation, scale);
}
template <class A>
void fields(A& archive, Is<scene::Material> auto& material) {
  auto& [name, base_color, emissive, metallic, roughness, transmission, ior, double_sided, unlit] = material;
  archive(name, base_color, emissive, metallic, roughness, transmission, ior, double_sided, unlit);
}
template <class A>
void fields(A& archive, Is<scene::Light> auto& light) {
  auto& [name, kind, color, intensity, range, inner_cone_rad, outer_cone_rad, position, direction] = light;
  archive(name, kind, color, intensity, range, inner_cone_rad, outer_cone_rad, position, direction);
}
template <class A>
void fields(A& archive, Is<scene::Camera> auto& camera) {
  auto& [name, kind, yfov_rad, aspect_ratio, xmag, ymag, znear, zfar, world_from_camera] = camera;
  archive(name, kind, yfov_rad, aspect_ratio, xmag, ymag, znear, zfar, world_from_camera);
}
template <class A>
void fields(A& archive, Is<scene::Node> auto& node) {
  auto& [name, parent, local, trs, file_index, mesh_id, skin_id, weights] = node;
  archive(name, parent, local, trs, file_index, mesh_id, skin_id, weights);
}
template <class A>
void fields(A& archive, Is<scene::Skin> auto& skin) {
  auto& [name, joints, inverse_bind, skeleton] = skin;
  archive(name, joints, inverse_bind, skeleton);
}
template <class A>
void fields(A& archive, Is<scene::AnimationChannel> auto& channel) {
  auto& [node, path, interpolation, times_s, values] = channel;
  archive(node, path, interpolation, times_s, values);
}
template <class A>
void fields(A& archive, Is<scene::Animation> auto& animation) {
  auto& [name, channels] = animation;
  archive(name, channels);
}
template <class A>
void fields(A& archive, Is<scene::InstanceData> auto& instance) {
  auto& [name, mesh_id, world_from_object, node, skin_id, entry] = instance;
  archive(name, mesh_id, world_from_object, node, skin_id, entry);
}
/// The meshes are files of their own.
template <class A>
void fields(A& archive, Is<scene::SceneData> auto& data) {
  auto& [name, meshes, deformations, instances, entries, materials, cameras, lights, nodes, skins, animations,
         warnings] = data;
  archive(name, deformations, instances, entries, materials, cameras, lights, nodes, skins, animations,
          warnings);
}
template <class A>
void fields(A& archive, Is<scene::NodePoses> auto& nodes) {
  auto& [locals, parts, worlds] = nodes;
  archive(locals, parts, worlds);
}
template <class A>
void fields(A& archive, Is<scene::AnimationMoment> auto& moment) {
  auto& [animation_id, time_s] = moment;
  archive(animation_id, time_s);
}
template <class A>
void fields(A& archive, Is<scene::Pose> auto& pose) {
  auto& [nodes, weights, joints, animation] = pose;
  archive(nodes, weights, joints, animation);
}
template <class A>
void fields(A& archive, Is<scene::InstanceState> auto& instance) {
  auto& [world_from_object, mesh_id, alive, mask] = instance;
  archive(world_from_object, mesh_id, alive);
  if (archive.format() >= 2) archive(mask);
}
template <class A>
void fields(A& archive, Is<scene::InstanceChange> auto& change) {
  auto& [instance_id, state] = change;
  archive(instance_id, state);
}
template <class A>
void fields(A& archive, Is<scene::InstanceName> auto& named) {
  auto& [instance_id, name] = named;
  archive(instance_id, name);
}
template <class A>
void fields(A& archive, Is<StoredMesh> auto& mesh) {
  auto& [file, build] = mesh;
  archive(file, build);
}
template <class A>
void fields(A& archive, Is<Snapshot> auto& snapshot) {
  auto& [version, build, data, pose, source_meshes, meshes, instances, added_names, new_names] = snapshot;
  archive(version, build, data, pose, source_meshes, meshes, instances, added_names);
  if (archive.format() >= 2) archive(new_names);
}

}  // namespace gridcast::server::store
