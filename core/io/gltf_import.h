#pragma once
// The parts of the importer that turn a checked model into SceneData, one concept a file. They throw Refusal.

#include <string>
#include <vector>

#include "core/io/gltf.h"
#include "core/io/gltf_storage.h"
#include "core/scene/scene_data.h"

namespace gridcast::io {

/// Notes on what was skipped; a file of many oddities gets the first hundred and a count of the rest.
class Warnings {
 public:
  void add(std::string sentence);
  [[nodiscard]] std::vector<std::string> take();

 private:
  static constexpr std::size_t kMaxKept = 100;
  std::vector<std::string> kept_;
  std::size_t dropped_ = 0;
};

struct ImportContext {
  Storage& storage;
  Warnings& warnings;
  const GltfOptions& options;
};

/// Fills `meshes` and `deformations`, one per mesh of the file.
void import_meshes(ImportContext& context, scene::SceneData& out);
/// Fills `materials`.
void import_materials(const tinygltf::Model& model, scene::SceneData& out);
/// Fills `nodes`, `instances`, `cameras` and `lights` for the chosen scene. Returns the place in `nodes` of
/// each node of the file.
[[nodiscard]] std::vector<std::uint32_t> import_nodes(ImportContext& context, scene::SceneData& out);
/// Fills `skins` and checks that the joints which vertices name exist. `place` is what import_nodes returned.
void import_skins(ImportContext& context, const std::vector<std::uint32_t>& place, scene::SceneData& out);
/// Fills `animations`.
void import_animations(ImportContext& context, const std::vector<std::uint32_t>& place,
                       scene::SceneData& out);

}  // namespace gridcast::io
