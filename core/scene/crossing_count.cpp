#include "core/scene/crossing_count.h"

#include <algorithm>

#include "core/mesh/crossing.h"

namespace gridcast::scene {
namespace {

constexpr std::size_t kFewOffers = 64;

int crossing_in_range(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit, double tfar,
                      const std::array<Vec3f, 3>& corners) {
  if (!(hit.t <= tfar)) return 0;
  const Vec3d p0(corners[0]), p1(corners[1]), p2(corners[2]);
  const int crossing = mesh::line_crossing(ray.origin, ray.direction, p0, p1, p2);
  if (crossing == 0) return 0;
  const bool ahead = ray.tnear == 0.0 ? mesh::is_ahead(ray.origin, p0, p1, p2, crossing) : hit.t >= ray.tnear;
  return ahead ? crossing : 0;
}

}  // namespace

void CrossingCount::start(double tfar) {
  set_tfar(tfar);
  hits_ = crossings_ = 0;
  winding_ = 0;
}

void CrossingCount::enter(const mesh::TriangleMesh& mesh) {
  mesh_ = &mesh;
  offered_.clear();
  compact_at_ = kFewOffers;
}

blas::Offer CrossingCount::offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit,
                                 std::uint32_t primitive_id) {
  if (primitive_id == ray.excluded_primitive) return blas::Offer::kGoOn;
  if (!offered_.empty() && offered_.back().primitive_id == primitive_id) return blas::Offer::kGoOn;
  const int crossing = crossing_in_range(ray, hit, tfar(), mesh_->corners(primitive_id));
  const bool in_range = mesh::in_range(ray, hit, tfar(), primitive_id);
  if (crossing == 0 && !in_range) return blas::Offer::kGoOn;
  offered_.push_back({primitive_id, std::int8_t(crossing), in_range});
  if (offered_.size() >= compact_at_) {
    compact();
    compact_at_ = 2 * std::max(offered_.size(), kFewOffers);
  }
  return blas::Offer::kGoOn;
}

/// Several leaves may hold a triangle: each is kept once, so memory is bounded by the triangles hit.
void CrossingCount::compact() {
  std::sort(offered_.begin(), offered_.end(),
            [](const Offered& a, const Offered& b) { return a.primitive_id < b.primitive_id; });
  const auto same = [](const Offered& a, const Offered& b) { return a.primitive_id == b.primitive_id; };
  offered_.erase(std::unique(offered_.begin(), offered_.end(), same), offered_.end());
}

void CrossingCount::leave() {
  compact();
  for (const Offered& one : offered_) {
    hits_ += std::uint32_t(one.in_range);
    crossings_ += std::uint32_t(one.crossing != 0);
    winding_ += one.crossing;
  }
}

}  // namespace gridcast::scene
