#include "server/store/tree_files.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/blas/tree_codec.h"

namespace gridcast::server::store {
namespace {

/// "GCTF" and the version of what stands before a tree.
constexpr std::uint32_t kMagic = 0x46544347;
constexpr std::uint32_t kVersion = 1;

struct Head {
  std::uint32_t magic = kMagic;
  std::uint32_t version = kVersion;
  Digest key{};
  Digest checksum{};  ///< SHA-256 of the tree
};
static_assert(sizeof(Head) == 72);

std::string_view bytes_of(const Head& head) {
  return {reinterpret_cast<const char*>(&head), sizeof head};
}

std::int64_t nanoseconds(const timespec& time) {
  return std::int64_t(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
}

std::int64_t now_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  return nanoseconds(now);
}

Error wrong(const std::string& path, const std::string& what) {
  return {ErrorCode::kInvalidFile, path + " " + what, ""};
}

Status check(const std::string& path, const Digest& key, std::string_view bytes) {
  Head head;
  if (bytes.size() < sizeof head) return wrong(path, "is cut off");
  std::memcpy(&head, bytes.data(), sizeof head);
  if (head.magic != kMagic) return wrong(path, "holds no tree");
  if (head.version != kVersion)
    return Error{ErrorCode::kUnsupported, path + " is of version " + std::to_string(head.version), ""};
  if (head.key != key) return wrong(path, "is named as another tree");
  if (sha256(bytes.substr(sizeof head)) != head.checksum)
    return wrong(path, "is damaged: its checksum is wrong");
  return ok_status();
}

}  // namespace

Digest tree_key(const Digest& mesh, const blas::BuildOptions& options) {
  std::string text = "tree " + std::to_string(blas::kTreeFormat) + " ";
  text.append(reinterpret_cast<const char*>(mesh.data()), mesh.size());
  for (const std::uint8_t option :
       {std::uint8_t(options.kind), std::uint8_t(options.split), std::uint8_t(options.spatial),
        std::uint8_t(options.motion), std::uint8_t(options.quality)})
    text.push_back(char(option));
  return sha256(text);
}

Status TreeFiles::open() {
  if (::mkdir(folder_.c_str(), 0700) != 0 && errno != EEXIST) return system_error("making", folder_, errno);
  const std::lock_guard lock(mutex_);
  std::error_code failed;
  for (std::filesystem::directory_iterator entry(folder_, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    const std::string path = entry->path().string();
    const std::string name = entry->path().filename().string();
    struct stat status {};
    if (name.starts_with(kTemporary)) {
      ::unlink(path.c_str());
    } else if (const auto key = parse_hex(name); key && ::lstat(path.c_str(), &status) == 0) {
      entries_[*key] = {std::uint64_t(status.st_size), nanoseconds(status.st_mtim)};
      bytes_ += std::uint64_t(status.st_size);
    }
  }
  if (failed) return system_error("listing", folder_, failed.value());
  make_room(0);
  return ok_status();
}

bool TreeFiles::contains(const Digest& key) const {
  const std::lock_guard lock(mutex_);
  return entries_.contains(key);
}

Result<TreeFile> TreeFiles::get(const Digest& key) {
  const std::string path = path_of(key);
  if (!contains(key)) return Error{ErrorCode::kNotFound, path + " is missing", ""};
  auto bytes = read_file(path);
  if (!bytes) return bytes.error();
  if (Status sound = check(path, key, *bytes); !sound) return sound.error();
  // The times in memory count while this process runs, that of the file for the next.
  ::utimensat(AT_FDCWD, path.c_str(), nullptr, AT_SYMLINK_NOFOLLOW);
  const std::lock_guard lock(mutex_);
  if (const auto entry = entries_.find(key); entry != entries_.end()) entry->second.used_ns = now_ns();
  return TreeFile(*std::move(bytes), sizeof(Head));
}

Status TreeFiles::put(const Digest& key, std::string_view tree) {
  const std::uint64_t bytes = sizeof(Head) + tree.size();
  if (bytes > limit_bytes_)
    return Error{ErrorCode::kLimitExceeded,
                 "a tree of " + std::to_string(bytes) + " bytes is more than all may be", ""};
  {
    const std::lock_guard lock(mutex_);
    make_room(bytes);
  }
  const Head head{.key = key, .checksum = sha256(tree)};
  const std::string temporary = folder_ + "/" + std::string(kTemporary) + std::to_string(next_temporary_++);
  Status written = write_new_file(temporary, {bytes_of(head), tree});
  if (written && ::rename(temporary.c_str(), path_of(key).c_str()) != 0)
    written = system_error("renaming", temporary, errno);
  if (!written) {
    ::unlink(temporary.c_str());
    return written;
  }
  const std::lock_guard lock(mutex_);
  Entry& entry = entries_[key];
  bytes_ += bytes - entry.bytes;
  entry = {bytes, now_ns()};
  return ok_status();
}

void TreeFiles::remove(const Digest& key) {
  const std::lock_guard lock(mutex_);
  if (const auto entry = entries_.find(key); entry != entries_.end()) remove_locked(entry);
}

void TreeFiles::keep_only(const std::set<Digest>& wanted) {
  const std::lock_guard lock(mutex_);
  for (auto entry = entries_.begin(); entry != entries_.end();) {
    const auto next = std::next(entry);
    if (!wanted.contains(entry->first)) remove_locked(entry);
    entry = next;
  }
}

std::uint64_t TreeFiles::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

bool TreeFiles::empty() const {
  const std::lock_guard lock(mutex_);
  return entries_.empty();
}

void TreeFiles::remove_locked(std::map<Digest, Entry>::iterator entry) {
  ::unlink(path_of(entry->first).c_str());
  bytes_ -= entry->second.bytes;
  entries_.erase(entry);
}

void TreeFiles::make_room(std::uint64_t bytes) {
  while (bytes_ + bytes > limit_bytes_ && !entries_.empty())
    remove_locked(
        std::ranges::min_element(entries_, {}, [](const auto& entry) { return entry.second.used_ns; }));
}

}  // namespace gridcast::server::store
