#include "server/http/incoming_body.h"

#include "server/http/problem.h"

namespace gridcast::server {
namespace {

/// A time in which a request waits for its client: it is no load, and its deadline moves.
class Pause {
 public:
  Pause(HeavyLoad& heavy, Cancellation& cancellation)
      : heavy_(heavy), cancellation_(cancellation), left_(cancellation.deadline() - begun_) {
    cancellation_.lift_deadline();
    heavy_.pause(begun_);
  }
  ~Pause() {
    const Clock::time_point now = Clock::now();
    heavy_.resume(now);
    cancellation_.set_deadline(now + left_);
  }
  Pause(const Pause&) = delete;
  Pause& operator=(const Pause&) = delete;

 private:
  HeavyLoad& heavy_;
  Cancellation& cancellation_;
  const Clock::time_point begun_ = Clock::now();
  const Clock::duration left_;
};

}  // namespace

std::optional<proto::Problem> BodyOnTheWay::read(std::span<char> to,
                                                 const std::function<void()>& before_wait) {
  std::optional<Pause> pause;
  const auto error = connection_.read_next(to, [&] {
    before_wait();
    pause.emplace(heavy_, cancellation_);
  });
  if (!error) {
    bytes_left_ -= to.size();
    return std::nullopt;
  }
  if (error->problem) return error->problem;
  if (cancellation_.reason() == CancelReason::kShutdown) return cancelled_problem(CancelReason::kShutdown);
  client_gone_ = true;
  return cancelled_problem(CancelReason::kDisconnected);
}

}  // namespace gridcast::server
