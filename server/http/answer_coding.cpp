#include "server/http/answer_coding.h"

#include "proto/content_coding.h"
#include "proto/etag.h"
#include "proto/media_type.h"
#include "proto/zstd.h"

namespace gridcast::server {
namespace {

using proto::AnswerCoding;

// Below, an answer fits into a packet or two either way.
constexpr std::size_t kMinBytes = 1024;

/// Pictures are packed already.
bool shrinks(std::string_view content_type) {
  const std::string_view essence = content_type.substr(0, content_type.find(';'));
  return essence.starts_with("text/") || essence.ends_with("json") || essence.ends_with("+xml") ||
         essence.starts_with("application/vnd.gridcast.") || essence == proto::kGlbMediaType;
}

std::string joined(const BodyParts& body) {
  std::string text;
  text.reserve(body.bytes());
  for (const auto& part : body.parts) text.append(reinterpret_cast<const char*>(part.data()), part.size());
  return text;
}

void pack_etag(HttpResponse& response) {
  for (auto& [name, value] : response.headers)
    if (name == "ETag") value = proto::packed_etag(value);
}

}  // namespace

void encode_answer(const HttpRequest& request, HttpResponse& response, const Cancellation& cancellation) {
  const bool not_modified = response.status == 304;
  const std::size_t bytes = response.body.size() + response.in_parts.bytes();
  if (response.status >= 400 || response.stream || (bytes == 0 && !not_modified)) return;
  const AnswerCoding coding = proto::choose_answer_coding(request.header("accept-encoding"));
  const bool worth_it = shrinks(response.content_type);
  if (!worth_it && !not_modified && coding != AnswerCoding::kZstdOnly) return;
  response.with("Vary", "Accept-Encoding");
  // The client's own tag comes back, so that it finds what it has.
  if (not_modified && proto::has_packed_etag(request.header("if-none-match"))) pack_etag(response);
  if (not_modified || request.method == "HEAD" || coding == AnswerCoding::kIdentity) return;
  if (coding == AnswerCoding::kZstd && bytes < kMinBytes) return;
  auto encoded = response.in_parts.parts.empty()
                     ? proto::encode_zstd(response.body, cancellation.token())
                     : proto::encode_zstd(joined(response.in_parts), cancellation.token());
  if (!encoded || (coding == AnswerCoding::kZstd && encoded->size() >= bytes)) return;
  response.body = std::move(*encoded);
  response.in_parts = {};
  response.with("Content-Encoding", std::string(proto::kZstdCoding));
  pack_etag(response);
}

}  // namespace gridcast::server
