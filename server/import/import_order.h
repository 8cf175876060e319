#pragma once
// What goes to the process that parses a model, and what comes back.

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/gltf.h"

namespace gridcast::server {

/// The hidden command that runs it.
inline constexpr std::string_view kImportCommand = "import-helper";

/// It ends with this code when there is no memory for its answer.
inline constexpr int kNoRoomExit = 4;

struct ImportOrder {
  io::GltfOptions options;
  std::uint64_t memory_bytes = 0;  ///< that it may use beyond what it has when it starts
  std::uint64_t output_bytes = 0;  ///< that its answer may take
  std::uint64_t cpu_s = 0;
  std::uint64_t parent = 0;  ///< the process that waits for it
};

/// Stands before the model, and says where it ends.
[[nodiscard]] std::string encode(const ImportOrder& order);
struct ImportInput {
  ImportOrder order;
  std::string_view model;
};
/// kInvalidFile when it is none.
[[nodiscard]] Result<ImportInput> decode_import(std::string_view bytes);

/// Sizes and pieces, one after the other: what an answer is made of.
[[nodiscard]] std::vector<std::string> encode_outcome(const Result<scene::SceneData>& outcome);
/// The scene or the error that was written; kInvalidFile with an empty `where` when it is no answer.
struct ImportAnswer {
  bool understood = false;
  Result<scene::SceneData> outcome;
};
[[nodiscard]] ImportAnswer decode_outcome(std::string_view bytes);

}  // namespace gridcast::server
