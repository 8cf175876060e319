#pragma once

#include <cstdint>
#include <vector>

#include "core/blas/collector.h"
#include "core/mesh/triangle_mesh.h"

namespace gridcast::scene {

/// Counts the hits and crossings of one ray, instance by instance, each triangle once.
class CrossingCount final : public blas::HitSink {
 public:
  CrossingCount() : HitSink(0.0) {}

  void start(double tfar);
  /// The next offers are about an instance of `mesh`.
  void enter(const mesh::TriangleMesh& mesh);
  blas::Offer offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit,
                    std::uint32_t primitive_id) override;
  /// Adds the instance to the sums.
  void leave();

  [[nodiscard]] std::uint32_t hits() const { return hits_; }
  [[nodiscard]] std::uint32_t crossings() const { return crossings_; }
  [[nodiscard]] std::int32_t winding() const { return winding_; }

 private:
  struct Offered {
    std::uint32_t primitive_id;
    std::int8_t crossing;  ///< as mesh::line_crossing says; 0 out of range
    bool in_range;
  };
  void compact();

  const mesh::TriangleMesh* mesh_ = nullptr;
  std::vector<Offered> offered_;
  std::size_t compact_at_ = 0;
  std::uint32_t hits_ = 0;
  std::uint32_t crossings_ = 0;
  std::int32_t winding_ = 0;
};

}  // namespace gridcast::scene
