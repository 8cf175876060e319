#pragma once
// Whose request it is: what its token grants, and what is left of its quotas.

#include <optional>
#include <string>
#include <string_view>

#include "proto/error_table.h"
#include "server/access/rate_limit.h"
#include "server/access/token.h"
#include "server/http/http_types.h"

namespace gridcast::server::access {

/// One token at work, shared by all of its requests. Any thread may call.
class Caller {
 public:
  explicit Caller(Token token)
      : token_(std::move(token)), requests_(token_.requests_per_s), rays_(token_.rays_per_s) {}

  [[nodiscard]] const Token& token() const { return token_; }
  [[nodiscard]] bool sees_scene(std::string_view scene) const;
  /// quota_exceeded when one more request, or `rays` more rays, would be too many by now.
  [[nodiscard]] std::optional<proto::Problem> charge_request();
  [[nodiscard]] std::optional<proto::Problem> charge_rays(double rays);

 private:
  const Token token_;
  RateLimit requests_, rays_;
};

// Of a request whose caller may be null: without access control everything may be seen and nothing is
// charged.

/// Whose the things are that a request makes: the token's name, or empty.
[[nodiscard]] std::string owner_of(const HttpRequest& request);
[[nodiscard]] bool sees_scene(const HttpRequest& request, std::string_view scene);
/// An admin sees what all made, others what they made themselves.
[[nodiscard]] bool sees_job_of(const HttpRequest& request, std::string_view owner);
[[nodiscard]] std::optional<proto::Problem> charge_rays(const HttpRequest& request, double rays);

}  // namespace gridcast::server::access
