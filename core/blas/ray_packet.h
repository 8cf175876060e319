#pragma once
// Rays that are traced together.

#include <cstddef>
#include <cstdint>

#include "core/math/ray.h"

namespace gridcast::blas {

/// Sixteen valid rays in the object space of one mesh, as columns. Lanes from `count` on repeat another ray
/// and get no answer.
struct alignas(64) RayPacket {
  static constexpr std::size_t kSize = 16;

  double origin[3][kSize];
  double direction[3][kSize];
  double tnear[kSize];
  double tfar[kSize];
  std::uint32_t excluded_primitive[kSize];  ///< kInvalidId = none
  std::uint32_t instance_id = 0;
  std::uint32_t count = 0;  ///< 1 to kSize

  void set(std::size_t lane, const Ray& ray) {
    for (int axis = 0; axis < 3; ++axis) {
      origin[axis][lane] = ray.origin[axis];
      direction[axis][lane] = ray.direction[axis];
    }
    tnear[lane] = ray.tnear;
    tfar[lane] = ray.tfar;
  }
  [[nodiscard]] Ray ray(std::size_t lane) const {
    return {{origin[0][lane], origin[1][lane], origin[2][lane]},
            {direction[0][lane], direction[1][lane], direction[2][lane]},
            tnear[lane],
            tfar[lane]};
  }
};

/// What became of a packet.
struct PacketResult {
  bool traced = false;      ///< false: its rays are too far apart to share work; nothing was done
  std::uint32_t hits = 0;   ///< a bit per lane whose `best` was replaced (any hit: which is occluded)
  std::uint32_t steps = 0;  ///< nodes and leaves that its rays looked at together
};

// Where sharing pays: rays whose slopes differ by up to kMaxPacketSlopes, and whose origins (moved along the
// rays to a common plane) differ by up to kMaxPacketOrigins of the mesh's diagonal. Beyond, the packet visits
// so much more than each of its rays that single rays are faster.
inline constexpr double kMaxPacketSlopes = 0.04;
inline constexpr double kMaxPacketOrigins = 0.02;

}  // namespace gridcast::blas
