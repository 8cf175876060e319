#include <algorithm>
#include <utility>

#include "server/access/caller.h"
#include "server/http/problem.h"
#include "server/routes/api.h"
#include "server/store/sha256.h"

namespace gridcast::server {
namespace {

using proto::ProblemCode;

constexpr std::size_t kMaxKeyBytes = 255;

bool is_key(std::string_view text) {
  return !text.empty() && text.size() <= kMaxKeyBytes &&
         std::ranges::all_of(text, [](char c) { return c > ' ' && c <= '~'; });
}

/// All of a request that decides about its answer.
std::string fingerprint(const HttpRequest& request) {
  std::string text = request.method + "\n" + request.path;
  for (const auto& [name, value] : request.query)
    for (const std::string& part : {name, value})
      text.append("\n").append(std::to_string(part.size())).append(part);
  for (const char* name : {"content-type", "if-match"}) text.append("\n").append(request.header(name));
  return store::to_hex(store::sha256(text + "\n" + store::to_hex(store::sha256(request.body))));
}

/// An entry for as long as a request is answered.
class OpenEntry {
 public:
  OpenEntry(KeptAnswers& kept, std::string key, const std::string& request)
      : kept_(kept), key_(std::move(key)), entry_(kept.open(key_, request)) {}
  ~OpenEntry() { kept_.close(key_, std::move(entry_)); }
  OpenEntry(const OpenEntry&) = delete;
  OpenEntry& operator=(const OpenEntry&) = delete;

  [[nodiscard]] KeptAnswers::Entry& operator*() const { return *entry_; }
  void keep(const HttpResponse& answer) const { kept_.keep(key_, entry_, answer); }

 private:
  KeptAnswers& kept_;
  const std::string key_;
  std::shared_ptr<KeptAnswers::Entry> entry_;
};

HttpResponse answer_once(Api& api, const Handler& handler, const HttpRequest& request,
                         Cancellation& cancellation) {
  const std::string key = request.header("idempotency-key");
  if (!is_key(key))
    return problem_response({ProblemCode::kInvalidHeader,
                             "Idempotency-Key must have 1 to 255 visible ASCII characters",
                             "Idempotency-Key"});
  const std::string print = fingerprint(request);
  // Two tokens that use the same key mean two requests.
  const OpenEntry entry(api.kept_answers, access::owner_of(request) + "\n" + key, print);
  if ((*entry).request != print)
    return problem_response({ProblemCode::kIdempotencyKeyReused,
                             "this key was sent with another path, parameters, If-Match or body",
                             "Idempotency-Key"});
  const auto turn = (*entry).turn.enter(cancellation.token());
  if (!turn) return problem_response(cancelled_problem(cancellation.reason()));
  if ((*entry).answer) {
    HttpResponse again = *(*entry).answer;
    return again.with("Idempotency-Replayed", "true");
  }
  HttpResponse response = handler(request, cancellation);
  // What was refused has changed nothing, and may go well the next time.
  if (response.status < 300) entry.keep(response);
  return response;
}

}  // namespace

Handler once_per_key(Api& api, Handler handler) {
  return [&api, handler = std::move(handler)](const HttpRequest& request, Cancellation& cancellation) {
    if (!request.headers.contains("idempotency-key")) return handler(request, cancellation);
    return answer_once(api, handler, request, cancellation);
  };
}

}  // namespace gridcast::server
