// What a data folder holds: the first byte chooses the kind. Bytes that are read come out again as they were,
// unless they are of an older format.

#include <cstring>

#include "server/store/scene_codec.h"
#include "tests/fuzz/fuzz_input.h"

using namespace gridcast;

namespace {

template <class T>
void check(const Result<T>& decoded, std::string_view bytes, std::uint32_t newest_format) {
  if (!decoded) {
    fuzz::require(!decoded.error().message.empty(), "a refusal says nothing");
    return;
  }
  std::uint32_t format = 0;
  std::memcpy(&format, bytes.data() + sizeof(format), sizeof(format));
  fuzz::require(format < newest_format || server::store::encode(*decoded) == bytes,
                "what was read is written otherwise");
}

/// A version to which any delta may be applied.
scene::SceneState small_state() {
  auto triangle = std::make_shared<mesh::TriangleMesh>();
  triangle->positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  triangle->triangles = {{0, 1, 2}};
  auto data = std::make_shared<scene::SceneData>();
  data->meshes.push_back(triangle);
  data->deformations.resize(1);
  data->instances.push_back({scene::SharedText("a"), {}, 0});
  return scene::state_of(*scene::build_scene(*data).value());
}

void apply(std::string_view bytes) {
  static const scene::SceneState first = small_state();
  scene::SceneState state = first;
  server::store::DeltaReplay replay(state);
  if (!replay.apply(bytes)) return;
  fuzz::require(replay.apply({}).ok() == false, "nothing is taken for a delta");
  // A state that no scene can have is refused; any other can be asked.
  if (state.instances.size() < 1000) (void)scene::restore_scene(std::move(state));
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::FuzzInput input(data, size);
  const std::uint32_t which = input.below(4);
  const std::string_view bytes = input.text();
  if (which == 0) check(server::store::decode_mesh(bytes), bytes, server::store::kContentFormat);
  if (which == 1) check(server::store::decode_data(bytes), bytes, server::store::kContentFormat);
  if (which == 2) check(server::store::decode_snapshot(bytes), bytes, server::store::kVersionFormat);
  if (which == 3) apply(bytes);
  return 0;
}
