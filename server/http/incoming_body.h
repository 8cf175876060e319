#pragma once

#include "server/http/connection.h"
#include "server/http/heavy_load.h"
#include "server/http/http_types.h"

namespace gridcast::server {

/// A body of known length that is read while the request's work is under way, which therefore counts as heavy
/// (HeavyLoad) only as long as it does not wait for its client.
class BodyOnTheWay final : public IncomingBody {
 public:
  /// Of a request that is counted in `heavy`. All outlive this.
  BodyOnTheWay(Connection& connection, HeavyLoad& heavy, Cancellation& cancellation, std::size_t bytes)
      : connection_(connection), heavy_(heavy), cancellation_(cancellation), bytes_left_(bytes) {}

  [[nodiscard]] std::size_t bytes_left() const override { return bytes_left_; }
  [[nodiscard]] std::optional<proto::Problem> read(std::span<char> to,
                                                   const std::function<void()>& before_wait) override;
  /// A read found that the client has gone.
  [[nodiscard]] bool client_gone() const { return client_gone_; }

 private:
  Connection& connection_;
  HeavyLoad& heavy_;
  Cancellation& cancellation_;
  std::size_t bytes_left_;
  bool client_gone_ = false;
};

}  // namespace gridcast::server
