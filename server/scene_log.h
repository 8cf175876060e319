#pragma once
// What led from one version of a scene to the next.

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <utility>
#include <vector>

#include "core/scene/update.h"

namespace gridcast::server {

/// The edits of one update: made by a request, read by the update, kept by the log, never copied.
using SharedEdits = std::shared_ptr<const std::vector<scene::SceneEdit>>;

/// What edits take in memory, with the lists and names that they hold.
[[nodiscard]] std::size_t memory_bytes(const std::vector<scene::SceneEdit>& edits);

/// The update that made a version.
struct LogLine {
  LogLine(std::uint64_t made, SharedEdits made_by)
      : version(made), edits(std::move(made_by)), bytes(memory_bytes(*edits)) {}

  std::uint64_t version;
  SharedEdits edits;
  std::size_t bytes;
};

/// The newest updates of one scene without a gap, as many as fit into some bytes. Not thread-safe.
class SceneLog {
 public:
  /// Empty: begins behind `version`.
  SceneLog(std::uint64_t version, std::size_t max_bytes) : since_(version), max_bytes_(max_bytes) {}

  /// Its version is the one after the last. The oldest lines go when the bytes are used up, this one too
  /// where it has more alone. Edits that no transaction can hold (AddMesh) end the log: it begins behind
  /// them. Returns what went, for the caller to free where it likes.
  std::deque<LogLine> add(LogLine line);
  /// At most `limit` lines after `version`, which lies in [since(), the newest].
  [[nodiscard]] std::vector<LogLine> after(std::uint64_t version, std::size_t limit) const;
  /// The oldest version whose successors are all there.
  [[nodiscard]] std::uint64_t since() const { return since_; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }
  /// Forgets every line, and returns them.
  std::deque<LogLine> clear();

 private:
  std::uint64_t since_;
  std::size_t max_bytes_;
  std::size_t bytes_ = 0;
  std::deque<LogLine> lines_;  ///< versions since_ + 1, since_ + 2, ...
};

}  // namespace gridcast::server
