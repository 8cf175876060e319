#include "core/scene/hit_list.h"

#include <algorithm>

namespace gridcast::scene {

void HitList::start(double tfar, const HitPosition& after, std::size_t max_hits) {
  set_tfar(tfar);
  after_ = after;
  wanted_ = max_hits + 1;
  last_ = {.t = tfar};
  hits_.clear();
}

blas::Offer HitList::offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit,
                           std::uint32_t primitive_id) {
  if (!mesh::in_range(ray, hit, tfar(), primitive_id)) return blas::Offer::kGoOn;
  const Hit candidate{hit.t, hit.u, hit.v, ray.instance_id, primitive_id};
  if (!is_behind(candidate, after_) || !closer(candidate, last_)) return blas::Offer::kGoOn;
  hits_.push_back(candidate);
  if (hits_.size() < 2 * wanted_) return blas::Offer::kGoOn;
  compact();
  if (hits_.size() < wanted_) return blas::Offer::kGoOn;
  last_ = hits_.back();
  set_tfar(last_.t);
  return blas::Offer::kNarrowed;
}

// Several leaves may hold a triangle: the same triangle has the same t, so its copies lie side by side. A
// copy of a hit that was dropped is not closer than `last_` either.
void HitList::compact() {
  std::sort(hits_.begin(), hits_.end(), closer);
  const auto same = [](const Hit& a, const Hit& b) {
    return a.instance_id == b.instance_id && a.primitive_id == b.primitive_id;
  };
  hits_.erase(std::unique(hits_.begin(), hits_.end(), same), hits_.end());
  if (hits_.size() > wanted_) hits_.resize(wanted_);
}

RayStatus HitList::finish() {
  compact();
  if (hits_.empty()) return RayStatus::kMiss;
  if (hits_.size() < wanted_) return RayStatus::kHit;
  hits_.pop_back();
  return RayStatus::kTruncated;
}

}  // namespace gridcast::scene
