#pragma once
// Answers leave packed where their clients take that (RFC 9110, 12.5.3).

#include "server/http/http_types.h"

namespace gridcast::server {

/// Packs the body of a handler's answer as the request's Accept-Encoding allows: from 1 KiB on, of types that
/// shrink, when it does get smaller. Whoever refuses a body as it is gets any body packed. An error, a stream
/// and the answer of a HEAD stay as they are, and so does an answer whose packing is cancelled on the way:
/// its work is done, and may have changed something. Adds Vary and Content-Encoding, and changes the ETag.
void encode_answer(const HttpRequest& request, HttpResponse& response, const Cancellation& cancellation);

}  // namespace gridcast::server
