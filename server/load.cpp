#include "server/load.h"

#include <utility>

#include "server/http/http_types.h"

namespace gridcast::server {

Result<LoadedScene> load_scene(const Import& import, const LoadOptions& options) {
  const Clock::time_point started = Clock::now();
  auto data = import();
  if (!data) return data.error();
  const Clock::time_point imported = Clock::now();
  auto scene = build_scene(std::move(data).value(), {options.blas, options.stop, options.progress});
  if (!scene) return scene.error();
  return LoadedScene{std::move(scene).value(), ms_between(started, imported),
                     ms_between(imported, Clock::now())};
}

Result<LoadedScene> load_scene(std::span<const std::byte> bytes, const LoadOptions& options) {
  return load_scene([&] { return io::import_gltf(bytes, options.gltf); }, options);
}

Result<LoadedScene> load_scene_file(const std::string& path, const LoadOptions& options) {
  return load_scene([&] { return io::import_gltf_file(path, options.gltf); }, options);
}

}  // namespace gridcast::server
