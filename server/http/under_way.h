#pragma once

#include <cstddef>
#include <list>
#include <mutex>

namespace gridcast::server {

/// The requests at work, by their sockets. A server that ends waits for its own work, which it can cancel,
/// and not for clients that send or read as slowly as they may: after a while it shuts their sockets.
class UnderWay {
 public:
  /// One request, while this lives; its socket stays open meanwhile, and `all` lives longer.
  class Guard {
   public:
    Guard(UnderWay& all, int socket);
    ~Guard();
    Guard(const Guard&) = delete;
    Guard& operator=(const Guard&) = delete;

   private:
    UnderWay& all_;
    std::list<int>::iterator entry_;
  };

  [[nodiscard]] std::size_t count() const;

  /// Whoever waits for more from a client finds an end, now and later; answers can still be sent.
  void end_receiving();
  [[nodiscard]] bool has_ended_receiving() const;
  /// And whoever waits for a client to read: what it has not got is lost.
  void end_sending();

 private:
  mutable std::mutex mutex_;
  std::list<int> sockets_;
  bool receives_ = true;
  bool sends_ = true;
};

}  // namespace gridcast::server
