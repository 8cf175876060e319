#pragma once
// Models are parsed by a process of their own: what a hostile one does to a parser ends that process alone.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "core/io/gltf.h"

namespace gridcast::server {

struct ImportBounds {
  std::uint64_t memory_bytes = std::numeric_limits<std::uint64_t>::max();  ///< that a parse may take
  std::uint64_t cpu_s = 60;                                                ///< in case that nobody stops it
};

class ImportHelper {
 public:
  /// What is run: this program again, unless told otherwise.
  explicit ImportHelper(std::vector<std::string> command = own_command()) : command_(std::move(command)) {}

  /// io::import_gltf in the helper: same scenes, same errors. kInvalidFile, and a line in the log, when the
  /// helper fails or gives no answer; kLimitExceeded when there is no memory for it; kCancelled on `stop`.
  [[nodiscard]] Result<scene::SceneData> import(std::span<const std::byte> model,
                                                const io::GltfOptions& options, const ImportBounds& bounds,
                                                const std::stop_token& stop) const;

 private:
  [[nodiscard]] static std::vector<std::string> own_command();
  std::vector<std::string> command_;
};

/// The helper itself: reads an order from standard input, gives up what it does not need, parses, writes the
/// answer to standard output. Never returns.
[[noreturn]] void run_import_helper();

}  // namespace gridcast::server
