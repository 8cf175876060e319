#pragma once
// Rays of `exact` that are traced together.

#include <algorithm>
#include <type_traits>

#include "core/blas/ray_packet.h"
#include "core/math/hit.h"
#include "core/mesh/exact_ray.h"
#include "core/mesh/exact_test.h"

namespace gridcast::blas {

class Blas;

/// A packet of images of world rays, with what exact decisions need beside them.
struct ExactPacket : RayPacket {
  const Ray* world[kSize];
  bool is_image[kSize];
  double drift[kSize];
  const Affine* world_from_object = nullptr;
  const mesh::TriangleMesh* mesh = nullptr;
  mesh::ExactBest* best = nullptr;  ///< of every lane, where closest hits are asked for; starts as its tfar

  /// False when the image is not close: such a ray goes alone.
  bool set_image(std::size_t lane, const Ray& ray, const mesh::ExactImage& image) {
    set(lane, {image.origin, image.direction, ray.tnear, ray.tfar});
    world[lane] = &ray;
    is_image[lane] = image.is_image;
    drift[lane] = image.drift;
    return image.is_close;
  }
  [[nodiscard]] mesh::ExactImage image(std::size_t lane) const {
    const Ray object = ray(lane);
    return {object.origin, object.direction, drift[lane], true, is_image[lane]};
  }
};

/// Blas::intersect_packet and occluded_packet of `exact`, which those take for a packet of this kind alone.
PacketResult intersect_packet_exact(const Blas& blas, const ExactPacket& packet);
[[nodiscard]] PacketResult occluded_packet_exact(const Blas& blas, const ExactPacket& packet);

inline double largest_drift(const RayPacket& /*packet*/) {
  return 0.0;
}
inline double largest_drift(const ExactPacket& packet) {
  return *std::max_element(std::begin(packet.drift), std::end(packet.drift));
}

/// What packets of a precision consist of, and what becomes of a lane of closest hits.
template <Precision kPrecision>
using PacketOf = std::conditional_t<kPrecision == Precision::kExact, ExactPacket, RayPacket>;
template <Precision kPrecision>
using BestOf = std::conditional_t<kPrecision == Precision::kExact, mesh::ExactBest, Hit>;

}  // namespace gridcast::blas
