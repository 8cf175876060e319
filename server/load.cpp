#include "server/load.h"

#include <utility>

#include "server/http_types.h"

namespace gridcast::server {
namespace {

Result<LoadedScene> build(Result<scene::SceneData> data, const LoadOptions& options,
                          Clock::time_point started) {
  if (!data) return data.error();
  const Clock::time_point imported = Clock::now();
  auto scene = build_scene(std::move(data).value(), {options.blas, options.stop, options.progress});
  if (!scene) return scene.error();
  return LoadedScene{std::move(scene).value(), ms_between(started, imported),
                     ms_between(imported, Clock::now())};
}

}  // namespace

Result<LoadedScene> load_scene(std::span<const std::byte> bytes, const LoadOptions& options) {
  const Clock::time_point started = Clock::now();
  return build(io::import_gltf(bytes, options.gltf), options, started);
}

Result<LoadedScene> load_scene_file(const std::string& path, const LoadOptions& options) {
  const Clock::time_point started = Clock::now();
  return build(io::import_gltf_file(path, options.gltf), options, started);
}

}  // namespace gridcast::server
