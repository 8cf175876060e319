#include "server/bench/load_clients.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <deque>
#include <memory>
#include <random>
#include <string_view>
#include <unordered_map>
#include <vector>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/epoll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

namespace gridcast::server {
namespace {

using measure::ClockKind;
using measure::now_s;

constexpr double kLongestWaitForLast = 1.0;
constexpr std::string_view kEndOfHead = "\r\n\r\n";
// In a closed loop; who asks again at once measures refusals.
constexpr double kRestWhenRefused = 0.01;

enum class Keeps : std::uint8_t { kOpen, kClosed };

struct ClientConnection {
  Keeps keeps = Keeps::kOpen;
  bool at_work = false;
  bool waits_to_write = false;
  double begun = 0.0;
  std::size_t sent = 0;
  std::string head;         ///< of the answer, until it is whole
  std::size_t missing = 0;  ///< of the answer's body
  int status = 0;           ///< 0: the head has not come
};

/// The value of Content-Length in the head of an answer of ours.
std::size_t length_of(std::string_view head) {
  constexpr std::string_view kName = "\r\nContent-Length: ";
  const std::size_t at = head.find(kName);
  std::size_t length = 0;
  if (at != head.npos) std::from_chars(head.data() + at + kName.size(), head.data() + head.size(), length);
  return length;
}

class LoadClients {
 public:
  explicit LoadClients(const LoadPlan& plan)
      : plan_(plan), random_(plan.seed), epoll_(::epoll_create1(EPOLL_CLOEXEC)) {
    const std::string length = "Content-Length: " + std::to_string(plan.body.size()) + "\r\n";
    const auto request = [&](const char* more) {
      const std::string head = plan.head + length + more + "\r\n";
      std::string whole(head.size() + plan.body.size(), '\0');
      std::copy(head.begin(), head.end(), whole.begin());
      std::transform(plan.body.begin(), plan.body.end(), whole.begin() + std::ptrdiff_t(head.size()),
                     [](std::byte b) { return char(b); });
      return whole;
    };
    kept_request_ = request("");
    last_request_ = request("Connection: close\r\n");
  }
  ~LoadClients() {
    for (const auto& [socket, connection] : connections_) ::close(socket);
    ::close(epoll_);
  }
  LoadClients(const LoadClients&) = delete;
  LoadClients& operator=(const LoadClients&) = delete;

  LoadOutcome run() {
    const double cpu = now_s(ClockKind::kThread), begin = now_s(ClockKind::kWall);
    end_ = begin + plan_.seconds;
    double due = begin + gap();
    for (double now = begin; now < end_ && !plan_.stop.stop_requested(); now = now_s(ClockKind::kWall)) {
      if (plan_.in_flight > 0)
        while (at_work_ + resting(now) < plan_.in_flight && launch(Keeps::kOpen, now)) continue;
      else
        due = launch_due(due, now);
      const double next = plan_.in_flight > 0 ? (rests_.empty() ? end_ : rests_.front()) : due;
      take_events(std::min(next, end_) - now_s(ClockKind::kWall));
    }
    out_.seconds = now_s(ClockKind::kWall) - begin;
    const double last = now_s(ClockKind::kWall) + kLongestWaitForLast;
    for (double now = 0.0; at_work_ > 0 && now < last && !plan_.stop.stop_requested();
         now = now_s(ClockKind::kWall))
      take_events(0.01);
    out_.failed += at_work_;
    out_.cpu_s = now_s(ClockKind::kThread) - cpu;
    return std::move(out_);
  }

 private:
  double gap() {
    return plan_.per_s > 0.0 ? std::exponential_distribution<double>(plan_.per_s)(random_) : 1e9;
  }

  double launch_due(double due, double now) {
    for (; due <= now && due < end_; due += gap()) {
      out_.late_ms.push_back(1000.0 * (now_s(ClockKind::kWall) - due));
      const Keeps keeps = ++launched_ % 2 == 0 ? Keeps::kOpen : Keeps::kClosed;
      if (!launch(keeps, now_s(ClockKind::kWall))) ++out_.not_sent;
    }
    return due;
  }

  /// Clients of the closed loop that were refused a moment ago.
  std::size_t resting(double now) {
    while (!rests_.empty() && rests_.front() <= now) rests_.pop_front();
    return rests_.size();
  }

  bool launch(Keeps keeps, double now) {
    int socket = -1;
    if (keeps == Keeps::kOpen && !idle_.empty()) {
      socket = idle_.back();
      idle_.pop_back();
    } else {
      socket = open(keeps);
    }
    if (socket < 0) return false;
    ClientConnection& connection = connections_[socket];
    connection.keeps = keeps;
    connection.at_work = true;
    connection.begun = now;
    connection.sent = 0;
    connection.status = 0;
    connection.missing = 0;
    connection.head.clear();
    ++at_work_;
    ++out_.sent;
    write(socket, connection);
    return true;
  }

  int open(Keeps) {
    if (connections_.size() >= plan_.most_connections) return -1;
    const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (socket < 0) return -1;
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(std::uint16_t(plan_.port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const int one = 1;
    ::setsockopt(socket, IPPROTO_TCP, TCP_NODELAY, &one, sizeof(one));
    if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 &&
        errno != EINPROGRESS) {
      ::close(socket);
      return -1;
    }
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = socket;
    ::epoll_ctl(epoll_, EPOLL_CTL_ADD, socket, &event);
    connections_.emplace(socket, ClientConnection{});
    return socket;
  }

  void drop(int socket) {
    ::close(socket);
    connections_.erase(socket);
    std::erase(idle_, socket);
  }

  void write(int socket, ClientConnection& connection) {
    const std::string& request = connection.keeps == Keeps::kOpen ? kept_request_ : last_request_;
    while (connection.sent < request.size()) {
      const ssize_t n =
          ::send(socket, request.data() + connection.sent, request.size() - connection.sent, MSG_NOSIGNAL);
      // A refusal may come before the request is whole: what it says is read all the same.
      if (n <= 0) break;
      connection.sent += std::size_t(n);
    }
    const bool waits =
        connection.sent < request.size() && (errno == EAGAIN || errno == EINPROGRESS || errno == ENOTCONN);
    if (waits == connection.waits_to_write) return;
    connection.waits_to_write = waits;
    epoll_event event{};
    event.events = waits ? EPOLLIN | EPOLLOUT : EPOLLIN;
    event.data.fd = socket;
    ::epoll_ctl(epoll_, EPOLL_CTL_MOD, socket, &event);
  }

  void take_events(double seconds) {
    std::array<epoll_event, 64> events{};
    const double wait_s = std::clamp(seconds, 0.0, 0.1);
    const timespec wait{0, long(1e9 * wait_s)};
    const int count = ::epoll_pwait2(epoll_, events.data(), int(events.size()), &wait, nullptr);
    for (int i = 0; i < count; ++i) {
      const int socket = events[std::size_t(i)].data.fd;
      const auto found = connections_.find(socket);
      if (found == connections_.end()) continue;
      if ((events[std::size_t(i)].events & EPOLLOUT) != 0) write(socket, found->second);
      if ((events[std::size_t(i)].events & ~std::uint32_t(EPOLLOUT)) != 0) read(socket, found->second);
    }
  }

  void read(int socket, ClientConnection& connection) {
    const ssize_t n = ::recv(socket, piece_.data(), piece_.size(), 0);
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (n <= 0) {
      if (connection.at_work) give_up();
      drop(socket);
      return;
    }
    if (!connection.at_work) return;
    take(connection, std::string_view(piece_.data(), std::size_t(n)));
    if (connection.status == 0 || connection.missing > 0) return;
    finish(connection);
    const std::string& request = connection.keeps == Keeps::kOpen ? kept_request_ : last_request_;
    const bool ends = connection.keeps == Keeps::kClosed || connection.sent < request.size() ||
                      connection.head.find("\r\nConnection: close") != std::string::npos;
    if (ends)
      drop(socket);
    else
      idle_.push_back(socket);
  }

  static void take(ClientConnection& connection, std::string_view bytes) {
    if (connection.status != 0) {
      connection.missing -= std::min(connection.missing, bytes.size());
      return;
    }
    connection.head.append(bytes);
    const std::size_t end = connection.head.find(kEndOfHead);
    if (end == std::string::npos) return;
    const std::string_view head = std::string_view(connection.head).substr(0, end);
    constexpr std::string_view kVersion = "HTTP/1.1 ";
    if (head.size() > kVersion.size())
      std::from_chars(head.data() + kVersion.size(), head.data() + head.size(), connection.status);
    const std::size_t length = length_of(head), have = connection.head.size() - end - kEndOfHead.size();
    connection.missing = length - std::min(length, have);
    connection.head.resize(end);
  }

  void finish(ClientConnection& connection) {
    const double now = now_s(ClockKind::kWall), ms = 1000.0 * (now - connection.begun);
    connection.at_work = false;
    --at_work_;
    if (connection.status == 200) {
      out_.accepted_ms.push_back(ms);
      if (now <= end_) ++out_.accepted_in_time;
    } else if (connection.status == 503 || connection.status == 429) {
      out_.refused_ms.push_back(ms);
      if (plan_.in_flight > 0) rests_.push_back(now + kRestWhenRefused);
    } else {
      ++out_.failed;
    }
  }

  void give_up() {
    --at_work_;
    ++out_.failed;
  }

  const LoadPlan& plan_;
  std::mt19937_64 random_;
  const int epoll_;
  std::string kept_request_, last_request_;
  std::unordered_map<int, ClientConnection> connections_;
  std::vector<int> idle_;     ///< kept connections without a request
  std::deque<double> rests_;  ///< until when
  std::size_t at_work_ = 0, launched_ = 0;
  double end_ = 0.0;
  std::array<char, std::size_t(256) << 10> piece_{};
  LoadOutcome out_;
};

}  // namespace

LoadOutcome run_load(const LoadPlan& plan) {
  const auto clients = std::make_unique<LoadClients>(plan);
  return clients->run();
}

void allow_many_connections() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &limit);
}

}  // namespace gridcast::server
