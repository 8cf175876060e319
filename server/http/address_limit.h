#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "server/http/connection.h"

namespace gridcast::server {

/// How many connections each address has: whoever comes from one may have some, not all. Of IPv6 the first 64
/// bits count, which one customer usually has to itself. Any thread may ask.
class AddressLimit {
 public:
  /// 0: no limit.
  explicit AddressLimit(std::size_t most) : most_(most) {}

  using Key = std::array<unsigned char, 16>;
  /// One connection that is counted, until this goes.
  class Place {
   public:
    Place(AddressLimit* limit, const Key& key) : limit_(limit), key_(key) {}
    ~Place() {
      if (limit_ != nullptr) limit_->leave(key_);
    }
    Place(Place&& other) noexcept : limit_(std::exchange(other.limit_, nullptr)), key_(other.key_) {}
    Place(const Place&) = delete;
    Place& operator=(const Place&) = delete;
    Place& operator=(Place&&) = delete;

   private:
    AddressLimit* limit_;  ///< null: not counted
    Key key_;
  };
  /// For the other end of a connected socket; nothing when its address has as many as it may.
  [[nodiscard]] std::optional<Place> try_take(int socket);

 private:
  void leave(const Key& key);

  const std::size_t most_;
  std::mutex mutex_;
  std::map<Key, std::size_t> counts_;  ///< above 0
};

/// The connection of a socket, which has its place until it goes.
[[nodiscard]] std::shared_ptr<Connection> make_guest(AddressLimit::Place place, int socket,
                                                     const ConnectionLimits& limits);

}  // namespace gridcast::server
