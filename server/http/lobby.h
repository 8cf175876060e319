#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "server/http/connection.h"

namespace gridcast::server {

/// Where connections wait for a whole head, all of them with one thread. A client that sends slowly, or
/// nothing, costs a descriptor and what it has sent, never a thread that others need (the "slow loris"). When
/// every place is taken, who came last gets that of the one that has kept others waiting longest.
class Lobby {
 public:
  using Connections = std::vector<std::shared_ptr<Connection>>;
  /// What becomes of one whose head has come.
  enum class Then : std::uint8_t { kLeaves, kStays, kEnds };
  struct Exits {
    /// A head has come: it was answered at once, or it leaves. Keeps others from entering meanwhile.
    std::function<Then(Connection&)> answered;
    std::function<void(std::shared_ptr<Connection>)> ready;  ///< it leaves
    std::function<void(const Connection&)> late;             ///< a head has not come in time
    std::function<void(const Connection&)> evicted;          ///< its place went to another
  };

  Lobby(std::size_t places, Exits exits);
  ~Lobby();
  Lobby(const Lobby&) = delete;
  Lobby& operator=(const Lobby&) = delete;

  /// From any thread. A closed lobby closes the connection.
  void enter(std::shared_ptr<Connection> connection);
  /// Lets those out whose head has come, and closes all others.
  void close();

 private:
  void run();
  /// Whether somebody was answered.
  bool look_at(int socket);
  /// Closes those who waited too long.
  void sweep();
  /// Under mutex_: takes one out.
  std::shared_ptr<Connection> take(int socket);
  [[nodiscard]] int longest_waiting() const;

  const std::size_t places_;
  const Exits exits_;
  const int epoll_;
  std::mutex mutex_;
  std::map<int, std::shared_ptr<Connection>> waiting_;  ///< by socket
  bool closed_ = false;
  std::jthread thread_;
};

}  // namespace gridcast::server
