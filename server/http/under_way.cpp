#include "server/http/under_way.h"

#include <sys/socket.h>

namespace gridcast::server {

UnderWay::Guard::Guard(UnderWay& all, int socket) : all_(all) {
  const std::lock_guard lock(all_.mutex_);
  entry_ = all_.sockets_.insert(all_.sockets_.end(), socket);
  if (!all_.sends_)
    ::shutdown(socket, SHUT_RDWR);
  else if (!all_.receives_)
    ::shutdown(socket, SHUT_RD);
}

UnderWay::Guard::~Guard() {
  const std::lock_guard lock(all_.mutex_);
  all_.sockets_.erase(entry_);
}

std::size_t UnderWay::count() const {
  const std::lock_guard lock(mutex_);
  return sockets_.size();
}

void UnderWay::end_receiving() {
  const std::lock_guard lock(mutex_);
  receives_ = false;
  for (const int socket : sockets_) ::shutdown(socket, SHUT_RD);
}

bool UnderWay::has_ended_receiving() const {
  const std::lock_guard lock(mutex_);
  return !receives_;
}

void UnderWay::end_sending() {
  const std::lock_guard lock(mutex_);
  sends_ = false;
  for (const int socket : sockets_) ::shutdown(socket, SHUT_RDWR);
}

}  // namespace gridcast::server
