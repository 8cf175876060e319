#pragma once
// The nearest hits of one ray behind a position, in bounded memory.

#include <cstddef>
#include <span>
#include <vector>

#include "core/blas/collector.h"
#include "core/math/hit_lists.h"

namespace gridcast::scene {

/// Keeps the `max_hits` nearest and knows whether there are more: it collects one hit too many, which is what
/// narrows the range. Memory for 2 (max_hits + 1) hits, duplicates included.
class HitList final : public blas::HitSink {
 public:
  HitList() : HitSink(0.0) {}

  /// Forgets everything. Hits up to `tfar` and strictly behind `after` count from now on.
  void start(double tfar, const HitPosition& after, std::size_t max_hits);
  blas::Offer offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit,
                    std::uint32_t primitive_id) override;
  /// In order, each once, at most max_hits. kMiss, kHit, or kTruncated when there are more.
  [[nodiscard]] RayStatus finish();
  [[nodiscard]] std::span<const Hit> hits() const { return hits_; }

 private:
  void compact();

  HitPosition after_;
  std::size_t wanted_ = 0;  ///< max_hits + 1
  Hit last_;                ///< of `wanted_` hits; what is not closer is of no interest
  std::vector<Hit> hits_;
};

}  // namespace gridcast::scene
