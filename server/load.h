#pragma once

#include <chrono>
#include <optional>
#include <span>
#include <string>
#include <variant>

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

/// Imports and builds: from memory (a client's bytes: nothing is opened) or from a file (the operator's own).
[[nodiscard]] Result<LoadedScene> load_scene(std::span<const std::byte> bytes, const LoadOptions& options);
[[nodiscard]] Result<LoadedScene> load_scene_file(const std::string& path, const LoadOptions& options);

}  // namespace gridcast::server
