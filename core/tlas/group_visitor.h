#pragma once

#include <cstddef>
#include <cstdint>

namespace gridcast::tlas {

/// Most rays that walk together.
inline constexpr std::size_t kGroupSize = 16;

/// What to do with an instance that some rays of a group may hit, as InstanceVisitor is for one ray.
struct GroupVisitor {
  const void* object;
  /// A bit of `rays` for each. No ray comes to another instance before finish().
  void (*visit)(const void* object, std::uint32_t instance_id, std::uint32_t rays, double* far);
  /// Sets far[ray] of the rays that came to instances to the largest t still of interest.
  void (*finish)(const void* object, double* far);
  /// Said of instances that are visited soon.
  void (*prefetch)(const void* object, std::uint32_t instance_id);
  /// Asked before a ray that may take long; false leaves the rest of the group where it is.
  bool (*goes_on)(const void* object);
};

}  // namespace gridcast::tlas
