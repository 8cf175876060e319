#include "server/http/problem.h"

#include "server/log.h"

namespace gridcast::server {

HttpResponse problem_response(const proto::Problem& problem) {
  HttpResponse response{problem.status(), std::string(proto::kProblemMediaType), to_json(problem), {}};
  if (response.status == 503 || response.status == 429)
    response.with("Retry-After", std::to_string(problem.retry_after_s));
  if (response.status == 401) response.with("WWW-Authenticate", "Bearer realm=\"gridcast\"");
  return response;
}

proto::Problem problem_of(const Error& error, proto::ErrorContext context, const Cancellation& cancellation) {
  if (error.code == ErrorCode::kCancelled) return cancelled_problem(cancellation.reason());
  // The client gets a fixed sentence for these; the operator gets the rest.
  if (error.code == ErrorCode::kInternal || error.code == ErrorCode::kIo)
    log_error(error.message + " (" + error.where + ")");
  return to_problem(error, context);
}

proto::Problem cancelled_problem(CancelReason reason) {
  switch (reason) {
    case CancelReason::kDeadline:
      return {proto::ProblemCode::kDeadlineExceeded, "the work was stopped at the request's deadline", ""};
    case CancelReason::kShutdown:
      return {proto::ProblemCode::kOverloaded, "the server is shutting down", ""};
    case CancelReason::kMemory:
      return {proto::ProblemCode::kMemoryFull, "the work was stopped: the server has no memory left for it",
              ""};
    case CancelReason::kDisconnected:
    case CancelReason::kRequested:
    case CancelReason::kNone:
      break;
  }
  return {proto::ProblemCode::kCancelled, "the work was stopped before it was done", ""};
}

}  // namespace gridcast::server
