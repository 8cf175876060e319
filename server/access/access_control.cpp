#include "server/access/access_control.h"

#include <algorithm>
#include <array>
#include <cctype>

#include <openssl/crypto.h>

#include "server/access/token_file.h"

namespace gridcast::server::access {
namespace {

using proto::Problem;
using proto::ProblemCode;

constexpr std::string_view kScene = "/v1/scenes/{s}";
/// What follows a scene's path where a POST only asks.
constexpr std::array<std::string_view, 7> kQuestions{"rays",    "points",    "visibility", "sensors",
                                                     "renders", "tradeoffs", "explain"};

bool is_question(std::string_view pattern) {
  if (!pattern.starts_with(kScene) || pattern.substr(kScene.size(), 1) != "/") return false;
  const std::string_view rest = pattern.substr(kScene.size() + 1);
  return std::ranges::find(kQuestions, rest.substr(0, rest.find('/'))) != kQuestions.end();
}

/// Of `Authorization: Bearer TOKEN`, the scheme in any case; empty when it is anything else.
std::string_view bearer_token(std::string_view header) {
  constexpr std::string_view kScheme = "bearer ";
  const bool is_bearer = header.size() > kScheme.size() &&
                         std::equal(kScheme.begin(), kScheme.end(), header.begin(), [](char want, char c) {
                           return want == char(std::tolower(static_cast<unsigned char>(c)));
                         });
  return is_bearer ? header.substr(kScheme.size()) : std::string_view();
}

}  // namespace

Need need_of(std::string_view method, std::string_view pattern) {
  if (pattern.starts_with("/healthz/")) return {Need::Who::kAnybody};
  const bool makes_or_deletes =
      (method == "POST" && (pattern == "/v1/scenes" || pattern.ends_with(":fork"))) ||
      (method == "DELETE" && pattern == kScene);
  if (makes_or_deletes) return {Need::Who::kToken, Role::kWrite, true};
  // A job is looked at and ended by who started it.
  const bool reads = pattern.empty() || method == "GET" || method == "HEAD" ||
                     pattern.starts_with("/v1/jobs/") || (method == "POST" && is_question(pattern));
  return {Need::Who::kToken, reads ? Role::kRead : Role::kWrite};
}

Result<std::unique_ptr<AccessControl>> AccessControl::open(const std::string& path) {
  std::unique_ptr<AccessControl> access(new AccessControl(path));
  if (const Status loaded = access->reload(); !loaded) return loaded.error();
  return access;
}

Status AccessControl::reload() {
  auto tokens = read_tokens(path_);
  if (!tokens) return tokens.error();
  if (tokens->empty()) return Error{ErrorCode::kIo, "the tokens file holds no token", path_};
  auto callers = std::make_shared<Callers>();
  for (Token& token : *tokens) callers->push_back(std::make_shared<Caller>(std::move(token)));
  const std::lock_guard lock(mutex_);
  callers_ = std::move(callers);
  return ok_status();
}

/// Digests are compared whole, every one of them, whatever comes: time tells nothing about how near a guess
/// is. A fast hash is right here: 256 random bits are not guessed, however many guesses a second there are.
std::shared_ptr<Caller> AccessControl::find(std::string_view token) const {
  const store::Digest digest = store::sha256(token);
  std::shared_ptr<const Callers> callers;
  {
    const std::lock_guard lock(mutex_);
    callers = callers_;
  }
  std::shared_ptr<Caller> found;
  for (const std::shared_ptr<Caller>& caller : *callers)
    if (CRYPTO_memcmp(caller->token().sha256.data(), digest.data(), digest.size()) == 0) found = caller;
  return found;
}

std::variant<std::shared_ptr<Caller>, Problem> AccessControl::admit(const HttpRequest& request,
                                                                    std::string_view pattern) const {
  const Need need = need_of(request.method, pattern);
  if (need.who == Need::Who::kAnybody) return std::shared_ptr<Caller>();
  std::shared_ptr<Caller> caller = find(bearer_token(request.header("authorization")));
  if (!caller)
    return Problem{ProblemCode::kUnauthorized, "send Authorization: Bearer with a valid token", ""};
  if (auto problem = caller->charge_request()) return *std::move(problem);
  // What a token does not see is answered as if it were not there.
  const auto scene = request.captures.find("s");
  if (scene != request.captures.end() && !caller->sees_scene(scene->second))
    return Problem{ProblemCode::kSceneNotFound, "there is no scene of this name", ""};
  if (caller->token().role < need.role)
    return Problem{ProblemCode::kForbidden,
                   "this takes a token with the role " + std::string(to_string(need.role)), ""};
  if (need.every_scene && caller->token().scenes)
    return Problem{ProblemCode::kForbidden, "this takes a token that is not restricted to some scenes", ""};
  return caller;
}

}  // namespace gridcast::server::access
