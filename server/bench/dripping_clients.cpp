#include "server/bench/dripping_clients.h"

#include <chrono>
#include <future>
#include <string_view>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

namespace gridcast::server {
namespace {

constexpr std::string_view kHead = "GET /v1/scenes HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ";

struct Drip {
  int socket = -1;
  std::size_t sent = 0;

  void connect(int port) {
    close();
    socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) close();
  }
  /// The head never ends: after it come the bytes of a field's value.
  void send_byte(int port) {
    const char byte = sent < kHead.size() ? kHead[sent] : 'x';
    if (socket < 0 || ::send(socket, &byte, 1, MSG_NOSIGNAL | MSG_DONTWAIT) != 1) connect(port);
    ++sent;
  }
  void close() {
    if (socket >= 0) ::close(socket);
    socket = -1;
    sent = 0;
  }
};

void drip(int port, std::size_t count, const std::stop_token& stop, std::promise<void> ready) {
  using Clock = std::chrono::steady_clock;
  std::vector<Drip> drips(count);
  for (Drip& one : drips) {
    if (stop.stop_requested()) break;
    one.connect(port);
    one.send_byte(port);
  }
  ready.set_value();
  const auto gap =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / double(count)));
  Clock::time_point due = Clock::now();
  for (std::size_t i = 0; !stop.stop_requested(); i = (i + 1) % count) {
    due += gap;
    std::this_thread::sleep_until(due);
    drips[i].send_byte(port);
  }
  for (Drip& one : drips) one.close();
}

}  // namespace

DrippingClients::DrippingClients(int port, std::size_t count) {
  std::promise<void> ready;
  std::future<void> all_connected = ready.get_future();
  thread_ = std::jthread([port, count, ready = std::move(ready)](const std::stop_token& stop) mutable {
    drip(port, count, stop, std::move(ready));
  });
  all_connected.wait();
}

}  // namespace gridcast::server
