#pragma once

#include <optional>
#include <variant>

#include "server/http/connection.h"
#include "server/http/heavy_load.h"
#include "server/http/http_head.h"
#include "server/work_gate.h"

namespace gridcast::server {

using TakenHead = std::optional<std::variant<HttpHead, HeadError>>;

/// A request whose head has come, and its place among the heavy ones, where it is one and has all come.
struct Turn {
  TakenHead head;
  std::optional<HeavyLoad::Place> place = std::nullopt;
  std::optional<WorkGate::Permit> long_place = std::nullopt;  ///< likewise of those that keep a thread
};

/// Who is let in, known before a thread is woken and a body read: what a refusal costs is taken from those
/// that are served. Any thread may ask.
class Admission {
 public:
  /// `heavy_requests` are never too many, others when all together take longer than `heavy_wait`; of those
  /// that keep a thread for long there are `long_requests` at once.
  Admission(std::size_t heavy_requests, std::chrono::milliseconds heavy_wait, std::size_t long_requests)
      : heavy_(heavy_requests, heavy_wait), long_(long_requests) {}

  /// False for a request that is to be refused. A heavy one gets its place here, or many would be let in
  /// while the first of them wake. Not so one whose body is still to come: its client could hold the place as
  /// long as it likes.
  [[nodiscard]] bool admit(const Connection& connection, Turn& turn);

  [[nodiscard]] HeavyLoad& heavy() { return heavy_; }

 private:
  HeavyLoad heavy_;
  WorkGate long_;
};

}  // namespace gridcast::server
