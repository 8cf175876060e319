#include "core/io/gltf_uri.h"

#include <algorithm>
#include <array>
#include <cstdint>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/io/gltf_refusal.h"

namespace gridcast::io {
namespace {

constexpr std::uint8_t kNotBase64 = 255;

std::uint8_t base64_value(char c) {
  if (c >= 'A' && c <= 'Z') return std::uint8_t(c - 'A');
  if (c >= 'a' && c <= 'z') return std::uint8_t(c - 'a' + 26);
  if (c >= '0' && c <= '9') return std::uint8_t(c - '0' + 52);
  if (c == '+' || c == '-') return 62;
  if (c == '/' || c == '_') return 63;
  return kNotBase64;
}

std::vector<std::byte> decode_base64(std::string_view text, const std::string& where) {
  for (int padding = 0; padding < 2 && text.ends_with('='); ++padding) text.remove_suffix(1);
  std::vector<std::byte> bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  std::uint32_t pending = 0;
  int bits = 0;
  for (const char c : text) {
    const std::uint8_t value = base64_value(c);
    if (value == kNotBase64) refuse_invalid("the data URI is not base64", where);
    pending = (pending << 6) | value;
    bits += 6;
    if (bits < 8) continue;
    bits -= 8;
    bytes.push_back(std::byte((pending >> bits) & 0xFF));
  }
  return bytes;
}

int hex_value(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string percent_decode(std::string_view uri, const std::string& where) {
  std::string path;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      path += uri[i];
      continue;
    }
    const int high = i + 2 < uri.size() ? hex_value(uri[i + 1]) : -1;
    const int low = i + 2 < uri.size() ? hex_value(uri[i + 2]) : -1;
    if (high < 0 || low < 0) refuse_invalid("the URI has a broken percent escape", where);
    path += char(high * 16 + low);
    i += 2;
  }
  return path;
}

/// Only a plain relative path is left: no scheme, root, backslash, control character or step up.
void check_relative_path(const std::string& path, const std::string& where) {
  const bool odd = std::ranges::any_of(
      path, [](char c) { return c == '\\' || c == ':' || static_cast<unsigned char>(c) < 0x20; });
  if (path.empty() || odd || path.front() == '/')
    refuse_invalid("the URI is not a plain relative path", where);
  for (const auto& part : std::filesystem::path(path))
    if (part == "..") refuse_invalid("the URI leaves the document's folder", where);
}

/// A file descriptor, closed at the end.
class OpenFile {
 public:
  explicit OpenFile(int descriptor) : descriptor_(descriptor) {}
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  ~OpenFile() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  [[nodiscard]] int get() const { return descriptor_; }

 private:
  int descriptor_;
};

}  // namespace

std::vector<std::byte> decode_data_uri(std::string_view uri, const std::string& where) {
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos) refuse_invalid("the data URI has no data", where);
  const std::string_view type = uri.substr(0, comma);
  static constexpr std::array<std::string_view, 2> kTypes = {"data:application/octet-stream;base64",
                                                             "data:application/gltf-buffer;base64"};
  if (std::ranges::find(kTypes, type) == kTypes.end())
    refuse_invalid(
        "a buffer's data URI must be base64 of application/octet-stream or application/gltf-buffer", where);
  return decode_base64(uri.substr(comma + 1), where);
}

std::string check_relative_uri(std::string_view uri, const std::string& where) {
  std::string path = percent_decode(uri, where);
  check_relative_path(path, where);
  return path;
}

std::vector<std::byte> read_plain_file(const std::filesystem::path& path, std::size_t max_bytes,
                                       const std::string& where) {
  // Not blocking: opening a pipe must not hang.
  const OpenFile file(open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status {};
  if (file.get() < 0) refuse(ErrorCode::kNotFound, "the file cannot be opened", where);
  if (fstat(file.get(), &status) != 0 || !S_ISREG(status.st_mode))
    refuse(ErrorCode::kIo, "not a plain file", where);
  if (std::uint64_t(status.st_size) > max_bytes)
    refuse(ErrorCode::kLimitExceeded, "the file is larger than the limit", where);
  std::vector<std::byte> bytes(std::size_t(status.st_size));
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t got = read(file.get(), bytes.data() + done, bytes.size() - done);
    if (got <= 0) refuse(ErrorCode::kIo, "the file cannot be read", where);
    done += std::size_t(got);
  }
  return bytes;
}

std::vector<std::byte> read_relative_uri(std::string_view uri, const std::filesystem::path& folder,
                                         std::size_t max_bytes, const std::string& where) {
  const std::string relative = check_relative_uri(uri, where);
  std::error_code failed;
  const auto root = std::filesystem::canonical(folder, failed);
  const auto target = failed ? std::filesystem::path() : std::filesystem::canonical(root / relative, failed);
  if (failed) refuse_invalid("the buffer's file cannot be found", where);
  const auto [from_root, from_target] = std::mismatch(root.begin(), root.end(), target.begin(), target.end());
  if (from_root != root.end()) refuse_invalid("the URI leaves the document's folder", where);

  return read_plain_file(target, max_bytes, where);
}

}  // namespace gridcast::io
