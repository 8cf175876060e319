#include "server/import/import_helper.h"

#include <algorithm>
#include <csignal>
#include <cstring>
#include <new>
#include <utility>

#include <unistd.h>

#include "server/child_process.h"
#include "server/import/import_order.h"
#include "server/log.h"

namespace gridcast::server {
namespace {

/// Names, nodes and instances, beside what is counted as decoded.
constexpr std::uint64_t kOtherBytes = std::uint64_t(1) << 30;

Error no_memory() {
  return {ErrorCode::kLimitExceeded, "there is not enough memory for the document", ""};
}

/// What io::import_gltf allows a document of this size to decode to.
std::uint64_t decoded_limit(const io::GltfLimits& limits, std::uint64_t file_bytes) {
  return std::min<std::uint64_t>(limits.decoded_bytes,
                                 limits.decoded_bytes_free + limits.decoded_bytes_per_byte * file_bytes);
}

ImportOrder order_for(const io::GltfOptions& options, std::uint64_t file_bytes, const ImportBounds& bounds) {
  const std::uint64_t decoded = decoded_limit(options.limits, file_bytes);
  // The document, what it is decoded to, the scene, and the scene as bytes.
  const std::uint64_t needed = kOtherBytes + 3 * decoded + 4 * file_bytes;
  return {options, std::min(needed, bounds.memory_bytes), kOtherBytes + decoded, bounds.cpu_s,
          std::uint64_t(::getpid())};
}

std::string how_it_ended(const ChildEnd& end) {
  if (end.signal != 0) return std::string("it was ended by ") + ::strsignal(end.signal);
  return "it ended with code " + std::to_string(end.exit_code);
}

Error fault(const std::string& what) {
  log_error("a model could not be read by the import helper: " + what);
  return {ErrorCode::kInvalidFile, "the document cannot be read: it made the reader fail", ""};
}

}  // namespace

std::vector<std::string> ImportHelper::own_command() {
  return {"/proc/self/exe", std::string(kImportCommand)};
}

Result<scene::SceneData> ImportHelper::import(std::span<const std::byte> model,
                                              const io::GltfOptions& options, const ImportBounds& bounds,
                                              const std::stop_token& stop) const try {
  if (model.size() > options.limits.file_bytes)
    return Error{ErrorCode::kLimitExceeded, "the file is larger than the limit", ""};
  const ImportOrder order = order_for(options, model.size(), bounds);
  const MemoryFile in("model"), out("scene"), messages("messages");
  const std::string_view text(reinterpret_cast<const char*>(model.data()), model.size());
  if (!in.is_open() || !out.is_open() || !messages.is_open() || !in.write_all({encode(order), text}))
    return no_memory();
  const auto end = run_child({command_, {}, in, out, messages}, stop);
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the import was stopped", ""};
  if (!end) {
    log_error("the import helper: " + end.error().message);
    return no_memory();
  }
  // Nobody but the system sends this signal.
  if (end->signal == SIGKILL || end->exit_code == kNoRoomExit) return no_memory();
  if (!end->went_well()) return fault(how_it_ended(*end));
  if (out.size_bytes() > order.output_bytes) return fault("its answer is too long");
  const MappedFile answer(out.descriptor(), std::size_t(out.size_bytes()));
  ImportAnswer decoded = decode_outcome(answer.text());
  if (!decoded.understood) return fault("it gave no answer");
  return std::move(decoded.outcome);
} catch (const std::bad_alloc&) {
  return no_memory();
}

}  // namespace gridcast::server
