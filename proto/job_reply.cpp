#include "proto/job_reply.h"

#include "proto/replies_json.h"

namespace gridcast::proto {

using Json = nlohmann::ordered_json;

std::string to_json(const JobInfo& info) {
  const std::string path = "/v1/jobs/" + info.id;
  Json json = {{"id", info.id},
               {"kind", info.kind},
               {"scene", info.scene},
               {"scene_version", std::to_string(info.scene_version)},
               {"state", info.state},
               {"progress", info.progress},
               {"created_at", info.created_at},
               {"wait_ms", info.wait_ms},
               {"run_ms", info.run_ms},
               {"events", path + "/events"},
               {"result", nullptr},
               {"problem", nullptr}};
  if (info.result)
    json["result"] = {
        {"path", path + "/result"}, {"media_type", info.result->media_type}, {"bytes", info.result->bytes}};
  if (info.problem) json["problem"] = problem_json(*info.problem);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string event_text(std::string_view name, std::uint64_t id, std::string_view data) {
  std::string text = "event: ";
  text.append(name)
      .append("\nid: ")
      .append(std::to_string(id))
      .append("\ndata: ")
      .append(data)
      .append("\n\n");
  return text;
}

}  // namespace gridcast::proto
