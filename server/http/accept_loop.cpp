#include "server/http/accept_loop.h"

#include <cerrno>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>

namespace gridcast::server {

void accept_connections(int listening, const std::atomic<bool>& stopping,
                        const std::function<bool(int)>& take) {
  // Until some descriptors are closed.
  constexpr std::chrono::milliseconds kOutOfDescriptors{1};
  ::fcntl(listening, F_SETFL, ::fcntl(listening, F_GETFL) | O_NONBLOCK);
  bool has_refused = false;
  while (!stopping) {
    const int socket = ::accept4(listening, nullptr, nullptr, SOCK_CLOEXEC);
    if (socket >= 0) {
      if (take(socket)) has_refused = true;
    } else if (errno == EAGAIN) {
      pollfd entry{listening, POLLIN, 0};
      if (std::exchange(has_refused, false))
        std::this_thread::sleep_for(kRestAfterRefusal);
      else
        ::poll(&entry, 1, -1);
    } else if (errno == EMFILE || errno == ENFILE || errno == ENOBUFS || errno == ENOMEM) {
      std::this_thread::sleep_for(kOutOfDescriptors);
    } else if (errno == EBADF || errno == EINVAL || errno == ENOTSOCK) {
      return;
    }
    // Anything else is of one connection that has gone before it was accepted.
  }
}

}  // namespace gridcast::server
