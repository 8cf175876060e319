#include "server/http/refusals.h"

#include "server/http/problem.h"

namespace gridcast::server {
namespace {

/// A whole answer that no library writes.
std::string plain_answer(const proto::Problem& problem, std::string_view more) {
  const HttpResponse response = problem_response(problem);
  std::string text = "HTTP/1.1 " + std::to_string(response.status) + " " +
                     std::string(proto::describe(problem.code).title) + "\r\n";
  for (const auto& [name, value] : response.headers)
    text.append(name).append(": ").append(value).append("\r\n");
  return text + "Content-Type: " + response.content_type +
         "\r\nContent-Length: " + std::to_string(response.body.size()) + "\r\n" + std::string(more) + "\r\n" +
         response.body;
}

std::string last_answer(const proto::Problem& problem) {
  return plain_answer(problem, "Connection: close\r\n");
}

RequestRecord record_of(const proto::Problem& problem) {
  return {"", "", problem.status(), 0.0, 0, 0, ""};
}

}  // namespace

Refusals::Refusals(const RequestObserver& observer, const std::atomic<bool>& stopping)
    : observer_(observer),
      stopping_(stopping),
      kept_(plain_answer(too_many_, "")),
      last_(last_answer(too_many_)) {}

Refusals::Left Refusals::refuse(Connection& connection, const HttpHead* request) const {
  const bool is_whole = request != nullptr && connection.has_body(*request);
  const bool goes_on = request != nullptr && !request->wants_close() && !stopping_ &&
                       !connection.is_used_up() && connection.skip_body(*request);
  const bool is_told = goes_on ? connection.write_now(kept_) : connection.write_last_now(last_);
  observer_(record_of(too_many_));
  if (goes_on) {
    connection.begin_wait();
    return is_told ? Left::kOpen : Left::kNothing;
  }
  if (is_whole) return Left::kNothing;
  connection.begin_close();
  return Left::kDraining;
}

void Refusals::refuse_stranger(Connection& connection) const {
  connection.write_last_now(last_answer(too_many_of_one_));
  observer_(record_of(too_many_of_one_));
  connection.begin_close();
}

void Refusals::answer(Connection& connection, const HeadError& error) const {
  const proto::Problem problem{error.code, error.detail, ""};
  observer_(record_of(problem));
  (void)connection.write(last_answer(problem));
  connection.begin_close();
}

void Refusals::turn_away(const Connection& connection, const proto::Problem& problem) const {
  if (!connection.head_begun()) return;
  connection.write_last_now(last_answer(problem));
  observer_(record_of(problem));
}

}  // namespace gridcast::server
