#include "server/store/file_store.h"

#include <cerrno>
#include <filesystem>
#include <system_error>

#include <unistd.h>

namespace gridcast::server::store {

Result<Digest> FileStore::put(std::string_view bytes) {
  const Digest digest = sha256(bytes);
  const std::string path = path_of(digest);
  // What is there already may be damaged, and another thread may not have come to syncing its name.
  if (!get(digest)) {
    const std::string temporary = folder_ + "/" + std::string(kTemporary) + std::to_string(next_temporary_++);
    Status written = write_new_file(temporary, {bytes});
    if (written && ::rename(temporary.c_str(), path.c_str()) != 0)
      written = system_error("renaming", temporary, errno);
    if (!written) {
      ::unlink(temporary.c_str());
      return written.error();
    }
    bytes_written_ += bytes.size();
  }
  if (Status synced = sync_folder(folder_); !synced) return synced.error();
  return digest;
}

Result<std::string> FileStore::get(const Digest& digest) const {
  const std::string path = path_of(digest);
  auto bytes = read_file(path);
  if (bytes && sha256(*bytes) != digest)
    return Error{ErrorCode::kInvalidFile, path + " is damaged: its checksum is not its name", ""};
  return bytes;
}

bool FileStore::contains(const Digest& digest) const {
  return ::access(path_of(digest).c_str(), R_OK) == 0;
}

void FileStore::remove(const Digest& digest) {
  ::unlink(path_of(digest).c_str());
}

Result<std::vector<Digest>> FileStore::sweep() {
  std::vector<Digest> found;
  std::error_code failed;
  for (std::filesystem::directory_iterator entry(folder_, failed), end; !failed && entry != end;
       entry.increment(failed)) {
    const std::string name = entry->path().filename().string();
    if (name.starts_with(kTemporary)) {
      ::unlink(entry->path().c_str());
    } else if (const auto digest = parse_hex(name)) {
      found.push_back(*digest);
    }
  }
  if (failed) return system_error("listing", folder_, failed.value());
  return found;
}

}  // namespace gridcast::server::store
