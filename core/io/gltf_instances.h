#pragma once

#include "core/io/gltf_import.h"

namespace gridcast::io {

/// A node of the chosen scene and where it is.
struct PlacedNode {
  const tinygltf::Node& source;
  std::uint32_t file_index;
  std::uint32_t place;  ///< index into SceneData::nodes
  const Affine& world;
};

/// The instance of a node with a mesh, or one for each entry of EXT_mesh_gpu_instancing. Throws Refusal.
void add_instances(ImportContext& context, const PlacedNode& node, scene::SceneData& out);
void add_camera(ImportContext& context, const PlacedNode& node, scene::SceneData& out);
void add_light(ImportContext& context, const PlacedNode& node, scene::SceneData& out);

}  // namespace gridcast::io
