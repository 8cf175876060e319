#pragma once

#include <utility>

#include "core/scene/update.h"
#include "proto/scene_request.h"

namespace gridcast::server {

/// A change of an instance as the engine takes it.
[[nodiscard]] inline scene::ChangeInstance change_edit(proto::InstanceChange request) {
  proto::ChangeInstanceRequest& change = request.change;
  return {request.instance_id, change.world_from_object, change.mask, std::move(change.name)};
}

}  // namespace gridcast::server
