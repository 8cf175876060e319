#pragma once

#include "proto/error_table.h"
#include "server/http/http_types.h"

namespace gridcast::server {

/// application/problem+json with the problem's status; Retry-After or WWW-Authenticate where the status asks
/// for it.
[[nodiscard]] HttpResponse problem_response(const proto::Problem& problem);

/// What an error of core means to the client of a request that may have been cancelled.
[[nodiscard]] proto::Problem problem_of(const Error& error, proto::ErrorContext context,
                                        const Cancellation& cancellation);
/// The problem of a request whose work was stopped.
[[nodiscard]] proto::Problem cancelled_problem(CancelReason reason);

}  // namespace gridcast::server
