#pragma once

#include <optional>
#include <string>

#include "proto/ray_request.h"
#include "server/routes/api.h"

namespace gridcast::server {

/// Traces the rays of a large binary body (HttpRequest::incoming) piece by piece while the rest comes, and
/// answers when all are traced, in binary. Nothing when the rays are better seen together, or when something
/// is not as it should be: then `begun` holds what was read of the body, and nothing has been charged or
/// answered. The answer is the same, bit for bit.
[[nodiscard]] std::optional<HttpResponse> cast_in_pieces(Api& api, const HttpRequest& request,
                                                         Cancellation& cancellation,
                                                         proto::RayQuestion question, std::string& begun);

/// Reads the rest of `incoming` behind what `body` holds.
[[nodiscard]] std::optional<proto::Problem> read_rest(IncomingBody& incoming, std::string& body);

}  // namespace gridcast::server
