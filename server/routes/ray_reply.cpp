#include "server/routes/ray_reply.h"

#include "proto/list_reply.h"

namespace gridcast::server {
namespace {

// Below, one copy and one write cost less than a write for each column.
constexpr std::size_t kBytesInParts = std::size_t(1) << 20;

}  // namespace

std::string encode(const HitColumns& hits, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_hits_json(hits, head)
                                      : write_hits_binary(hits, head).to_string();
}
std::string encode(const std::vector<RayStatus>& status, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_occlusion_json(status, head)
                                      : write_occlusion_binary(status, head).to_string();
}
std::string encode(const HitLists& lists, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_lists_json(lists, head)
                                      : write_lists_binary(lists, head).to_string();
}
std::string encode(const HitCounts& counts, const proto::ReplyHead& head, ReplyFormat format) {
  return format == ReplyFormat::kJson ? write_counts_json(counts, head)
                                      : write_counts_binary(counts, head).to_string();
}

proto::RayPlan plan_of(const scene::TraceStats& traced) {
  return {std::string(to_string(traced.order)), traced.reason, traced.packet_rays, traced.single_rays,
          traced.order_ms};
}

HttpResponse binary_response(proto::BinaryBody body, std::shared_ptr<const void> owner, const RayReply& to) {
  const bool in_parts = body.size_bytes() >= kBytesInParts;
  std::string whole = in_parts ? std::string() : body.to_string();
  to.timing.mark("encode");
  HttpResponse response = columns_response(std::move(whole), ReplyFormat::kBinary, to.version, to.timing);
  if (!in_parts) return response;
  struct Held {
    proto::BinaryBody body;
    std::shared_ptr<const void> columns;
  };
  const auto held = std::make_shared<const Held>(Held{std::move(body), std::move(owner)});
  response.in_parts.parts.push_back(std::as_bytes(std::span(held->body.head)));
  response.in_parts.parts.insert(response.in_parts.parts.end(), held->body.chunks.begin(),
                                 held->body.chunks.end());
  response.in_parts.owner = held;
  return response;
}

HttpResponse reply(const RayReply& to, Result<HitColumns>&& hits, const scene::TraceStats* traced) {
  if (!hits || to.format == ReplyFormat::kJson) return reply<HitColumns>(to, hits, traced);
  return reply_in_binary(to, std::move(hits).value(), traced, to.timing.mark("trace"));
}

}  // namespace gridcast::server
