#include "server/routes/reply_format.h"

#include <array>

#include "proto/media_type.h"
#include "server/http/problem.h"

namespace gridcast::server {

std::optional<ReplyFormat> reply_format(const HttpRequest& request) {
  const auto type = proto::parse_media_type(request.header("content-type"));
  const bool binary_first =
      type && (type->essence == proto::kRaysMediaType || type->essence == proto::kPointsMediaType ||
               type->essence == proto::kPairsMediaType);
  std::array<std::string_view, 2> offered{proto::kJsonMediaType, proto::kHitsMediaType};
  if (binary_first) std::swap(offered[0], offered[1]);
  const auto chosen = proto::negotiate(request.header("accept"), offered);
  if (!chosen) return std::nullopt;
  return offered[*chosen] == proto::kJsonMediaType ? ReplyFormat::kJson : ReplyFormat::kBinary;
}

HttpResponse not_acceptable() {
  return problem_response({proto::ProblemCode::kNotAcceptable,
                           "answers are application/json or application/vnd.gridcast.hits", "Accept"});
}

HttpResponse columns_response(std::string body, ReplyFormat format, std::uint64_t version,
                              const Timing& timing) {
  return HttpResponse{
      200,
      std::string(format == ReplyFormat::kJson ? proto::kJsonMediaType : proto::kHitsMediaType),
      std::move(body),
      {}}
      .with("Scene-Version", std::to_string(version))
      .with("Server-Timing", timing.header());
}

}  // namespace gridcast::server
