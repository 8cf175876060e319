#include "server/ray_reply.h"

#include "proto/list_reply.h"

namespace gridcast::server {

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

}  // namespace gridcast::server
