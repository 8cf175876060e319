#include "server/http/accept_loop.h"

#include <cerrno>
#include <chrono>
#include <thread>

#include <sys/socket.h>

namespace gridcast::server {

void accept_connections(int listening, const std::atomic<bool>& stopping,
                        const std::function<void(int)>& take) {
  // Until some descriptors are closed.
  constexpr std::chrono::milliseconds kOutOfDescriptors{1};
  while (!stopping) {
    const int socket = ::accept4(listening, nullptr, nullptr, SOCK_CLOEXEC);
    if (socket >= 0) {
      take(socket);
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      std::this_thread::sleep_for(kOutOfDescriptors);
    } else if (errno == EBADF || errno == EINVAL || errno == ENOTSOCK) {
      return;
    }
    // Anything else is of one connection that has gone before it was accepted.
  }
}

}  // namespace gridcast::server
