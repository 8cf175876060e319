#include "server/http/address_limit.h"

#include <algorithm>
#include <cstring>

#include <netinet/in.h>
#include <sys/socket.h>

namespace gridcast::server {
namespace {

constexpr std::size_t kCustomerBytes = 8;

/// Nothing when the other end has gone, or has no address.
std::optional<AddressLimit::Key> peer_of(int socket) {
  sockaddr_storage address{};
  socklen_t size = sizeof(address);
  if (::getpeername(socket, reinterpret_cast<sockaddr*>(&address), &size) != 0) return std::nullopt;
  AddressLimit::Key key{};
  if (address.ss_family == AF_INET) {
    const auto& v4 = reinterpret_cast<const sockaddr_in&>(address).sin_addr;
    std::memcpy(key.data() + key.size() - sizeof(v4), &v4, sizeof(v4));
    return key;
  }
  if (address.ss_family != AF_INET6) return std::nullopt;
  const auto& v6 = reinterpret_cast<const sockaddr_in6&>(address).sin6_addr;
  if (IN6_IS_ADDR_V4MAPPED(&v6))
    std::memcpy(key.data() + 12, v6.s6_addr + 12, 4);
  else
    std::memcpy(key.data(), v6.s6_addr, kCustomerBytes);
  return key;
}

}  // namespace

std::optional<AddressLimit::Place> AddressLimit::try_take(int socket) {
  const auto key = most_ == 0 ? std::nullopt : peer_of(socket);
  if (!key) return Place(nullptr, {});
  const std::lock_guard lock(mutex_);
  std::size_t& count = counts_[*key];
  if (count == most_) return std::nullopt;
  ++count;
  return Place(this, *key);
}

void AddressLimit::leave(const Key& key) {
  const std::lock_guard lock(mutex_);
  const auto found = counts_.find(key);
  if (--found->second == 0) counts_.erase(found);
}

std::shared_ptr<Connection> make_guest(AddressLimit::Place place, int socket,
                                       const ConnectionLimits& limits) {
  struct Guest {
    AddressLimit::Place place;
    Connection connection;
  };
  const std::shared_ptr<Guest> guest(new Guest{std::move(place), Connection(socket, limits)});
  return {guest, &guest->connection};
}

}  // namespace gridcast::server
