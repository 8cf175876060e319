#include "server/cli/input.h"

#include <cerrno>

#include <poll.h>
#include <unistd.h>

#include "core/io/image.h"

namespace gridcast::server {
namespace {

Result<std::string> read_standard_input(std::size_t max_bytes, const std::stop_token& stop) {
  constexpr std::size_t kPiece = std::size_t(1) << 20;
  constexpr int kLookMs = 100;  // how often Ctrl-C is looked at while nothing comes
  std::string text;
  while (!stop.stop_requested()) {
    pollfd entry{STDIN_FILENO, POLLIN, 0};
    if (::poll(&entry, 1, kLookMs) == 0) continue;
    const std::size_t before = text.size();
    text.resize(before + kPiece);
    const ssize_t n = ::read(STDIN_FILENO, text.data() + before, kPiece);
    text.resize(before + std::size_t(n > 0 ? n : 0));
    if (n == 0) return text;
    if (n < 0 && errno != EINTR && errno != EAGAIN) return Error{ErrorCode::kIo, "cannot be read", ""};
    if (text.size() > max_bytes)
      return Error{ErrorCode::kLimitExceeded, "more than " + std::to_string(max_bytes) + " bytes", ""};
  }
  return Error{ErrorCode::kCancelled, "interrupted", ""};
}

}  // namespace

Result<std::string> read_input(const std::string& path, std::size_t max_bytes, const std::stop_token& stop) {
  if (path == "-") return read_standard_input(max_bytes, stop);
  auto bytes = io::read_file(path, max_bytes);
  if (!bytes) return bytes.error();
  return std::string(reinterpret_cast<const char*>(bytes->data()), bytes->size());
}

}  // namespace gridcast::server
