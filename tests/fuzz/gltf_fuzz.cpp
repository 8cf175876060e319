// Files: any bytes are imported or refused, and what is imported can be built, asked and exported.

#include "core/io/gltf_export.h"
#include "core/scene/trace.h"
#include "tests/fuzz/fuzz_input.h"

using namespace gridcast;

namespace {

/// Small enough for thousands of runs a second.
io::GltfOptions small_limits() {
  io::GltfOptions options;
  options.limits.decoded_bytes = options.limits.decoded_bytes_free = std::size_t(4) << 20;
  options.limits.instances = options.limits.nodes = 2000;
  return options;
}

std::size_t triangles(const scene::SceneData& data) {
  std::size_t count = 0;
  for (const auto& mesh : data.meshes) count += mesh->triangle_count();
  return count;
}

/// What is written is read again, with as many instances that answer the same.
void check_export(const scene::Scene& scene) {
  const auto glb = io::export_glb(scene);
  fuzz::require(glb.ok(), "an imported scene cannot be exported");
  auto imported = io::import_gltf(std::as_bytes(std::span(*glb)));
  fuzz::require(imported.ok(), "an export is not read again");
  const auto again = scene::build_scene(*std::move(imported)).value();
  fuzz::require(again->instance_count() == scene.instance_count(), "an export has lost instances");
  for (int i = 0; i < 8; ++i) {
    const Ray ray{Vec3d(0.25 * i, 10.0, 0.1), Vec3d(0.01 * i, -1.0, 0.0)};
    const SurfaceHit a = scene::intersect(scene, ray), b = scene::intersect(*again, ray);
    fuzz::require(a.t == b.t && a.instance_id == b.instance_id && a.primitive_id == b.primitive_id,
                  "an export answers otherwise");
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span(data, size));
  Result<scene::SceneData> imported = io::import_gltf(bytes, small_limits());
  if (!imported) {
    fuzz::require(!imported.error().message.empty(), "a refusal says nothing");
    return 0;
  }
  for (const auto& mesh : imported->meshes)
    fuzz::require(mesh::validate(*mesh).ok(), "an imported mesh is invalid");
  if (triangles(*imported) > 2000) return 0;
  const auto built = scene::build_scene(*std::move(imported));
  fuzz::require(built.ok(), "an imported scene cannot be built");
  for (int i = 0; i < 8; ++i) {
    const Ray ray{Vec3d(0.25 * i, 10.0, 0.1), Vec3d(0.01 * i, -1.0, 0.0)};
    const SurfaceHit hit = scene::intersect(**built, ray);
    fuzz::require((hit.status == RayStatus::kHit) == (scene::occluded(**built, ray) == RayStatus::kHit),
                  "closest and any hit disagree");
  }
  check_export(**built);
  return 0;
}
