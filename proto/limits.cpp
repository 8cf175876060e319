#include "proto/limits.h"

#include <algorithm>
#include <thread>

#include "proto/replies_json.h"

namespace gridcast::proto {

nlohmann::ordered_json limits_json(const Limits& limits) {
  return {{"json_bytes", limits.json_bytes},
          {"json_depth", limits.json_depth},
          {"json_rays", limits.json_rays},
          {"binary_bytes", limits.binary_bytes},
          {"binary_rays", limits.binary_rays},
          {"hits_per_ray", limits.hits_per_ray},
          {"json_hits", limits.json_hits},
          {"binary_hits", limits.binary_hits},
          {"glb_bytes", limits.glb_bytes},
          {"image_side_px", limits.image_side_px},
          {"explain_steps", limits.explain_steps},
          {"image_samples", limits.image_samples},
          {"samples_per_pixel", limits.samples_per_pixel},
          {"bounce_depth", limits.bounce_depth},
          {"tradeoff_triangles", limits.tradeoff_triangles},
          {"tradeoff_accuracy_rays", limits.tradeoff_accuracy_rays},
          {"tradeoff_speed_rays", limits.tradeoff_speed_rays},
          {"tradeoff_repeat", limits.tradeoff_repeat},
          {"tradeoff_traces", limits.tradeoff_traces},
          {"instances_per_patch", limits.instances_per_patch},
          {"binary_instances", limits.binary_instances},
          {"transaction_edits", limits.transaction_edits},
          {"transaction_poses", limits.transaction_poses},
          {"instances_per_page", limits.instances_per_page},
          {"name_bytes", limits.name_bytes},
          {"scenes", limits.scenes},
          {"deadline_ms", limits.deadline_ms},
          {"jobs_queued", limits.jobs_queued},
          {"jobs_kept", limits.jobs_kept},
          {"job_result_bytes", limits.job_result_bytes},
          {"job_keep_ms", limits.job_keep_ms},
          {"job_deadline_ms", limits.job_deadline_ms},
          {"idempotency_keys", limits.idempotency_keys},
          {"idempotency_bytes", limits.idempotency_bytes},
          {"idempotency_keep_ms", limits.idempotency_keep_ms},
          {"memory_budget_bytes", limits.memory_budget_bytes},
          {"kept_versions", limits.kept_versions},
          {"log_bytes", limits.log_bytes},
          {"log_lines", limits.log_lines},
          {"event_streams", limits.event_streams},
          {"heavy_requests", limits.heavy_requests},
          {"heavy_wait_ms", limits.heavy_wait_ms},
          {"long_requests", limits.long_requests},
          {"connections_per_address", limits.connections_per_address}};
}

std::size_t default_heavy_requests() {
  return kHeavyRequestsPerCore * std::max(1U, std::thread::hardware_concurrency());
}

std::string to_json(const Limits& limits) {
  return limits_json(limits).dump();
}

}  // namespace gridcast::proto
