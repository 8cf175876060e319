#pragma once

#include <atomic>
#include <cstdint>
#include <string>

#include "proto/error_table.h"
#include "server/http/connection.h"
#include "server/http/http_server.h"

namespace gridcast::server {

/// What is said to those who are not served, by whichever thread finds out: no other is woken, nothing is
/// waited for, and the text of most of them is there already. What a refusal costs is taken from those who
/// are served.
class Refusals {
 public:
  /// Both outlive this. While `stopping`, no connection goes on.
  Refusals(const RequestObserver& observer, const std::atomic<bool>& stopping);

  /// What a refusal leaves of a connection.
  enum class Left : std::uint8_t {
    kOpen,      ///< it goes on: what is still to come of the request is known and not much
    kDraining,  ///< it closes soon: what still comes is thrown away, or its client might lose the answer
    kNothing,   ///< its last request has come whole, or it does not read its answers
  };
  /// `request` may be null: nobody knows what is still to come.
  [[nodiscard]] Left refuse(Connection& connection, const HttpHead* request) const;
  /// One more connection than its address may have.
  void refuse_stranger(Connection& connection) const;
  /// A head that is no request.
  void answer(Connection& connection, const HeadError& error) const;
  /// Whose head has begun and is waited for no longer.
  void turn_away(const Connection& connection, const proto::Problem& problem) const;

 private:
  const RequestObserver& observer_;
  const std::atomic<bool>& stopping_;
  const proto::Problem too_many_{proto::ProblemCode::kOverloaded, "too many requests", ""};
  const proto::Problem too_many_of_one_{proto::ProblemCode::kOverloaded,
                                        "too many connections from one address", ""};
  const std::string kept_, last_;
};

}  // namespace gridcast::server
