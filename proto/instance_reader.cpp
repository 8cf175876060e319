#include "proto/instance_reader.h"

#include "proto/geometry_reader.h"
#include "proto/instance_mask.h"

namespace gridcast::proto {

AddInstanceRequest read_added_instance(const ObjectReader& object, const Limits& limits) {
  AddInstanceRequest added;
  if (const JsonNode* mesh_id = object.require("mesh_id")) added.mesh_id = read_id(*mesh_id);
  if (const JsonNode* transform = object.find("transform"))
    added.world_from_object = read_transform(*transform);
  if (const JsonNode* name = object.find("name")) added.name = read_name(*name, limits.name_bytes);
  if (const JsonNode* mask = object.find("mask")) added.mask = read_instance_mask(*mask);
  return added;
}

ChangeInstanceRequest read_change(const JsonNode& node, const ObjectReader& object, const Limits& limits) {
  ChangeInstanceRequest change;
  if (const JsonNode* transform = object.find("transform"))
    change.world_from_object = read_transform(*transform);
  if (const JsonNode* mask = object.find("mask")) change.mask = read_instance_mask(*mask);
  if (const JsonNode* name = object.find("name")) change.name = read_name(*name, limits.name_bytes);
  if (!change.world_from_object && !change.mask && !change.name)
    node.fail(ProblemCode::kMissingField, "a transform, a mask or a name is required");
  return change;
}

}  // namespace gridcast::proto
