#include "core/io/gltf.h"

#include <algorithm>
#include <exception>
#include <new>
#include <string>

#include "core/io/glb_envelope.h"
#include "core/io/gltf_check.h"
#include "core/io/gltf_import.h"
#include "core/io/gltf_uri.h"

namespace gridcast::io {

void Warnings::add(std::string sentence) {
  if (kept_.size() < kMaxKept) {
    kept_.push_back(std::move(sentence));
  } else {
    ++dropped_;
  }
}

std::vector<std::string> Warnings::take() {
  if (dropped_ > 0) kept_.push_back("and " + std::to_string(dropped_) + " more warnings");
  return std::move(kept_);
}

namespace {

std::size_t decoded_limit(const GltfLimits& limits, std::size_t file_bytes) {
  // The product cannot overflow: files are bounded by file_bytes.
  return std::min(limits.decoded_bytes,
                  limits.decoded_bytes_free + limits.decoded_bytes_per_byte * file_bytes);
}

scene::SceneData import_document(std::span<const std::byte> bytes, const std::filesystem::path* folder,
                                 const GltfOptions& options) {
  const GltfLimits& limits = options.limits;
  if (bytes.size() > limits.file_bytes)
    refuse(ErrorCode::kLimitExceeded, "the file is larger than the limit");
  const auto envelope = open_envelope(bytes);
  if (!envelope) throw Refusal(envelope.error());
  Json document = parse_json(envelope->json, limits);
  check_document(document, limits);
  Buffers buffers = load_buffers(document, envelope->bin, folder, limits.file_bytes);
  std::size_t stored = bytes.size();
  for (const auto& owned : buffers.owned) stored += owned.size();

  const tinygltf::Model model = parse_model(std::move(document));
  Budget budget(decoded_limit(limits, stored));
  Storage storage(model, std::move(buffers), budget);
  Warnings warnings;
  ImportContext context{storage, warnings, options};
  scene::SceneData scene;
  import_materials(model, scene);
  import_meshes(context, scene);
  const std::vector<std::uint32_t> place = import_nodes(context, scene);
  import_skins(context, place, scene);
  import_animations(context, place, scene);
  scene.warnings = warnings.take();
  return scene;
}

/// Whatever is thrown inside becomes an Error here; texts of other libraries are not passed on.
Result<scene::SceneData> import_guarded(std::span<const std::byte> bytes, const std::filesystem::path* folder,
                                        const GltfOptions& options) {
  try {
    return import_document(bytes, folder, options);
  } catch (const Refusal& refusal) {
    return refusal.error();
  } catch (const std::bad_alloc&) {
    return Error{ErrorCode::kLimitExceeded, "there is not enough memory for the document", ""};
  } catch (const std::exception&) {
    return Error{ErrorCode::kInvalidFile, "the document cannot be read", ""};
  }
}

}  // namespace

Result<scene::SceneData> import_gltf(std::span<const std::byte> bytes, const GltfOptions& options) {
  return import_guarded(bytes, nullptr, options);
}

Result<scene::SceneData> import_gltf_file(const std::filesystem::path& path, const GltfOptions& options) {
  try {
    const std::filesystem::path folder =
        path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
    const auto bytes = read_plain_file(path, options.limits.file_bytes, "");
    return import_guarded(bytes, &folder, options);
  } catch (const Refusal& refusal) {
    return refusal.error();
  } catch (const std::exception&) {
    return Error{ErrorCode::kIo, "the file cannot be read", ""};
  }
}

}  // namespace gridcast::io
