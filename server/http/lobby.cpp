#include "server/http/lobby.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <tuple>
#include <utility>

#include <sys/epoll.h>
#include <unistd.h>

#include "server/http/accept_loop.h"

namespace gridcast::server {
namespace {

constexpr std::chrono::milliseconds kSweepPeriod{100};

int make_epoll() {
  const int epoll = ::epoll_create1(EPOLL_CLOEXEC);
  if (epoll < 0) throw std::system_error(errno, std::generic_category(), "epoll_create1");
  return epoll;
}

}  // namespace

Lobby::Lobby(std::size_t places, Exits exits)
    : places_(std::max<std::size_t>(1, places)), exits_(std::move(exits)), epoll_(make_epoll()) {
  thread_ = std::jthread([this] { run(); });
}

Lobby::~Lobby() {
  close();
  ::close(epoll_);
}

void Lobby::enter(std::shared_ptr<Connection> connection) {
  std::shared_ptr<Connection> evicted;
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    if (waiting_.size() >= places_) evicted = take(longest_waiting());
    const int socket = connection->socket();
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = socket;
    if (::epoll_ctl(epoll_, EPOLL_CTL_ADD, socket, &event) == 0)
      waiting_.emplace(socket, std::move(connection));
  }
  if (!evicted) return;
  // What it has sent may not have been looked at yet. Who is let out may come back at once and evict another,
  // and so on: not for ever, on one stack.
  constexpr int kMostNested = 8;
  thread_local int nested = 0;
  if (evicted->look() != Arrived::kHead || nested == kMostNested) {
    exits_.evicted(*evicted);
    return;
  }
  ++nested;
  exits_.ready(std::move(evicted));
  --nested;
}

void Lobby::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
  }
  if (thread_.joinable()) thread_.join();
}

std::shared_ptr<Connection> Lobby::take(int socket) {
  const auto found = waiting_.find(socket);
  if (found == waiting_.end()) return nullptr;
  ::epoll_ctl(epoll_, EPOLL_CTL_DEL, socket, nullptr);
  std::shared_ptr<Connection> connection = std::move(found->second);
  waiting_.erase(found);
  return connection;
}

/// Who is answered before begun heads, and those before idle connections: who trickles goes before who may
/// ask again.
int Lobby::longest_waiting() const {
  const auto rank = [](const auto& entry) {
    const int kind = entry.second->closing() ? 0 : entry.second->head_begun() ? 1 : 2;
    return std::tuple(kind, entry.second->waits_since());
  };
  return std::ranges::min_element(waiting_, {}, rank)->first;
}

bool Lobby::look_at(int socket) {
  std::shared_ptr<Connection> connection;
  Then then = Then::kEnds;
  {
    const std::lock_guard lock(mutex_);
    const auto found = waiting_.find(socket);
    if (found == waiting_.end()) return false;
    const Arrived arrived = found->second->look();
    if (arrived == Arrived::kNotYet) return false;
    if (arrived == Arrived::kHead) then = exits_.answered(*found->second);
    // It is watched already: that costs two calls of the system less than leaving and entering.
    if (then == Then::kStays) return true;
    connection = take(socket);
  }
  if (then == Then::kLeaves) exits_.ready(std::move(connection));
  return false;
}

void Lobby::sweep() {
  Connections late;
  {
    const std::lock_guard lock(mutex_);
    const Clock::time_point now = Clock::now();
    std::vector<int> sockets;
    for (const auto& [socket, connection] : waiting_)
      if (connection->waits_until() <= now) sockets.push_back(socket);
    for (const int socket : sockets) late.push_back(take(socket));
  }
  for (const auto& connection : late)
    if (connection->head_begun()) exits_.late(*connection);
}

void Lobby::run() {
  std::array<epoll_event, 64> events{};
  Clock::time_point next_sweep = Clock::now() + kSweepPeriod;
  const auto is_closed = [this] {
    const std::lock_guard lock(mutex_);
    return closed_;
  };
  while (!is_closed()) {
    const int count = ::epoll_wait(epoll_, events.data(), int(events.size()), int(kSweepPeriod.count()));
    bool has_answered = false;
    for (int i = 0; i < count; ++i)
      if (look_at(events[std::size_t(i)].data.fd)) has_answered = true;
    if (has_answered) std::this_thread::sleep_for(kRestAfterRefusal);
    if (Clock::now() < next_sweep) continue;
    sweep();
    next_sweep = Clock::now() + kSweepPeriod;
  }
  std::map<int, std::shared_ptr<Connection>> left;
  {
    const std::lock_guard lock(mutex_);
    left.swap(waiting_);
  }
  for (auto& [socket, connection] : left)
    if (connection->look() == Arrived::kHead) exits_.ready(std::move(connection));
}

}  // namespace gridcast::server
