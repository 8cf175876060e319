#include "proto/visibility_reply.h"

#include "proto/reply_columns.h"

namespace gridcast::proto {
namespace {

void write_visible(JsonText& text, std::span<const RayStatus> status) {
  write_list(text, "visible", status.size(), [&](std::size_t i) {
    text.raw(status[i] == RayStatus::kInvalid ? "null" : has_hit(status[i]) ? "false" : "true");
  });
}

}  // namespace

std::string write_blockers_json(const HitColumns& blockers, const ReplyHead& head) {
  constexpr std::size_t kBytesPerPair = 64;
  JsonText text(256 + kBytesPerPair * blockers.status.size());
  write_start(text, head, blockers.status);
  write_visible(text, blockers.status);
  write_hit_columns(text, blockers, head.fields);
  write_end(text, head);
  return std::move(text).take();
}

std::string write_visible_json(std::span<const RayStatus> status, const ReplyHead& head) {
  constexpr std::size_t kBytesPerPair = 8;
  JsonText text(256 + kBytesPerPair * status.size());
  write_start(text, head, status);
  write_visible(text, status);
  write_end(text, head);
  return std::move(text).take();
}

}  // namespace gridcast::proto
