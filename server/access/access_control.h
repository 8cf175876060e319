#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/error.h"
#include "server/access/caller.h"

namespace gridcast::server::access {

/// What a route asks of its caller.
struct Need {
  enum class Who : std::uint8_t { kAnybody, kToken };
  Who who = Who::kToken;
  Role role = Role::kRead;
  bool every_scene = false;  ///< a token that is restricted to some scenes is not enough
};
/// GET reads, POST to a question about a scene reads, all else writes; a scene is made, copied and deleted by
/// those who may touch every scene; probes are for anybody. An unknown route (no pattern) needs a token.
[[nodiscard]] Need need_of(std::string_view method, std::string_view pattern);

/// Bearer tokens (RFC 6750) from a file. Any thread may call.
class AccessControl {
 public:
  /// The errors of read_tokens(); kIo for a file without a token.
  [[nodiscard]] static Result<std::unique_ptr<AccessControl>> open(const std::string& path);

  /// Reads the file again: requests at work keep what they have, quotas start anew. On an error the tokens
  /// stay as they were.
  [[nodiscard]] Status reload();

  /// Who sends a request to the route of `pattern`, null for anybody at an open route; or why it is refused:
  /// unauthorized, quota_exceeded, scene_not_found (one that the token does not see), forbidden.
  [[nodiscard]] std::variant<std::shared_ptr<Caller>, proto::Problem> admit(const HttpRequest& request,
                                                                            std::string_view pattern) const;

 private:
  using Callers = std::vector<std::shared_ptr<Caller>>;
  explicit AccessControl(std::string path) : path_(std::move(path)) {}
  [[nodiscard]] std::shared_ptr<Caller> find(std::string_view token) const;

  const std::string path_;
  mutable std::mutex mutex_;  ///< guards callers_
  std::shared_ptr<const Callers> callers_;
};

}  // namespace gridcast::server::access
