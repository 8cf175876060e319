#pragma once
// Column answers leave as JSON or in binary.

#include <cstdint>
#include <optional>
#include <string>

#include "proto/hit_reply.h"
#include "server/routes/api.h"

namespace gridcast::server {

enum class ReplyFormat : std::uint8_t { kJson, kBinary };

/// What Accept asks for; without a preference, the answer comes in the form of the question.
[[nodiscard]] std::optional<ReplyFormat> reply_format(const HttpRequest& request);
/// 406 with what is on offer.
[[nodiscard]] HttpResponse not_acceptable();
/// 200 with the scene's version and the times.
[[nodiscard]] HttpResponse columns_response(std::string body, ReplyFormat format, std::uint64_t version,
                                            const Timing& timing);

}  // namespace gridcast::server
