#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>

#include "server/store/sha256.h"

namespace gridcast::server::store {

/// The digests of things that are in memory, as long as they are. Any number of threads may use one.
class KnownFiles {
 public:
  std::optional<Digest> find(const std::shared_ptr<const void>& thing) {
    const std::lock_guard lock(mutex_);
    const auto found = files_.find(thing);
    if (found == files_.end()) return std::nullopt;
    return found->second;
  }
  void add(const std::shared_ptr<const void>& thing, const Digest& file) {
    const std::lock_guard lock(mutex_);
    std::erase_if(files_, [](const auto& entry) { return entry.first.expired(); });
    files_.insert_or_assign(thing, file);
  }

 private:
  std::mutex mutex_;
  std::map<std::weak_ptr<const void>, Digest, std::owner_less<>> files_;
};

}  // namespace gridcast::server::store
