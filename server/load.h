#pragma once

#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>

#include "core/io/gltf.h"
#include "core/scene/scene.h"

namespace gridcast::server {

struct LoadOptions {
  blas::BuildOptions blas;
  io::GltfOptions gltf;
  std::stop_token stop;
  scene::ProgressCallback progress;  ///< of the build
};

struct LoadedScene {
  std::shared_ptr<const scene::Scene> scene;
  double import_ms = 0.0;
  double build_ms = 0.0;
};

/// Where a scene comes from.
using Import = std::function<Result<scene::SceneData>()>;
[[nodiscard]] Result<LoadedScene> load_scene(const Import& import, const LoadOptions& options);
/// Imports and builds: from memory (a client's bytes: nothing is opened) or from a file (the operator's own).
[[nodiscard]] Result<LoadedScene> load_scene(std::span<const std::byte> bytes, const LoadOptions& options);
[[nodiscard]] Result<LoadedScene> load_scene_file(const std::string& path, const LoadOptions& options);

}  // namespace gridcast::server
