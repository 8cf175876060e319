#pragma once

#include <cstdint>

namespace gridcast::tlas {

/// What to do with an instance that a ray may hit, without its type, so that the walk is compiled once per
/// instruction set. Costs an indirect call an instance.
struct InstanceVisitor {
  const void* object;
  /// Returns the largest t still of interest.
  double (*visit)(const void* object, std::uint32_t instance_id);
  /// Said of instances that are visited soon.
  void (*prefetch)(const void* object, std::uint32_t instance_id);
};

}  // namespace gridcast::tlas
