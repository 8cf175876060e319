#pragma once
// Asks a tree whose bytes may have lied all that a tree can be asked: answers may be wrong, but nothing may
// be read or written out of place.

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/blas/blas.h"
#include "core/blas/point_sink.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::test {

/// The nearest corner of what it is offered.
class NearestCorner final : public blas::PointSink {
 public:
  NearestCorner(const TriangleMesh& mesh, const Vec3d& center) : PointSink(center, 10.0), mesh_(mesh) {}
  void offer(std::uint32_t primitive_id) override {
    for (const Vec3f& corner : mesh_.corners(primitive_id))
      set_radius(std::min(radius(), glm::length(Vec3d(corner) - center())));
  }

 private:
  const TriangleMesh& mesh_;
};

inline void cast_some(const blas::Blas& blas, Random& random) {
  blas::RayPacket packet;
  packet.count = blas::RayPacket::kSize;
  for (std::size_t lane = 0; lane < blas::RayPacket::kSize; ++lane) {
    const Ray ray{{0.001 * double(lane), 0.1, 5.0}, {0.0, 0.0, -1.0}};
    packet.set(lane, ray);
    packet.excluded_primitive[lane] = kInvalidId;
    Ray other{3.0 * random.direction(), {}};
    other.direction = random.in_box(0.5) - other.origin;
    mesh::ObjectRay prepared;
    if (!prepared.prepare(other, blas.bounds())) continue;
    Hit best;
    best.t = other.tfar;
    blas.intersect<Precision::kRobust>(prepared, best);
    blas.intersect<Precision::kFast>(prepared, best);
    (void)blas.occluded<Precision::kRobust>(prepared, other.tfar);
  }
  Hit best[blas::RayPacket::kSize];
  for (Hit& hit : best) hit.t = 1e9;
  (void)blas.intersect_packet<Precision::kRobust>(packet, best);
  (void)blas.occluded_packet<Precision::kRobust>(packet);
}

inline void use_every_way(const blas::Blas& blas, const TriangleMesh& mesh) {
  Random random(9);
  cast_some(blas, random);
  NearestCorner sink(mesh, Vec3d(0.3, 0.2, 2.0));
  blas.search(sink);
  (void)blas.validate();
  if (!blas.can_refit()) return;
  TriangleMesh moved = mesh;
  for (Vec3f& p : moved.positions) p += Vec3f(random.in_box(0.3));
  const std::vector<std::uint32_t> one{3};
  if (const auto patched = blas.refit(share(moved), one)) cast_some(*patched, random);
  const auto refitted = blas.refit(share(moved));
  if (!refitted) return;
  cast_some(*refitted, random);
  if (const auto repair = refitted->repair()) cast_some(repair->blas, random);
}

}  // namespace gridcast::test
