#include "core/measure/accuracy.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

namespace gridcast::measure {
namespace {

constexpr std::size_t kRaysPerTask = 128;
/// The relative size of a float's last place, at most.
constexpr double kFloatStep = 0x1p-23;

/// The last place of a float of this size.
double float_ulp(double value) {
  const auto size = float(std::abs(value));
  return double(std::nextafter(size, std::numeric_limits<float>::infinity())) - double(size);
}

double rank(const std::vector<double>& sorted, double share) {
  const auto at = std::size_t(std::ceil(share * double(sorted.size())));
  return sorted[std::max<std::size_t>(at, 1) - 1];
}

}  // namespace

std::optional<Quantiles> quantiles_of(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  std::sort(values.begin(), values.end());
  return Quantiles{rank(values, 0.5), rank(values, 0.99), values.back()};
}

Truth::Truth(const exact::Reference& reference, const RaySet& rays, std::vector<std::uint8_t> inside,
             double diagonal)
    : reference_(&reference), rays_(&rays), inside_(std::move(inside)), diagonal_(diagonal) {
  inside_.resize(rays.size(), 0);
  hit_.resize(rays.size());
  closest_.resize(query_of(rays.kind) == QueryKind::kAny ? 0 : rays.size());
}

Result<Truth> Truth::find(const exact::Reference& reference, const RaySet& rays,
                          std::vector<std::uint8_t> inside, double diagonal, const std::stop_token& stop,
                          const scene::ProgressCallback& progress) {
  namespace tbb = oneapi::tbb;
  Truth truth(reference, rays, std::move(inside), diagonal);
  const RayBatch batch = rays.batch();
  std::atomic<std::size_t> done = 0;
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, rays.size(), kRaysPerTask),
      [&](const tbb::blocked_range<std::size_t>& range) {
        if (stop.stop_requested()) return;
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          if (truth.closest_.empty()) {
            truth.hit_[i] = reference.any(batch[i]) ? 1 : 0;
          } else {
            truth.closest_[i] = reference.closest(batch[i]);
            truth.hit_[i] = truth.closest_[i] ? 1 : 0;
          }
        }
        const std::size_t now = done += range.size();
        if (progress) progress(double(now) / double(rays.size()));
      },
      tbb::simple_partitioner());
  if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the measurement was stopped", ""};
  return truth;
}

struct Truth::Tally {
  Accuracy found;
  std::vector<double> error_ulp, error_relative;
};

Accuracy Truth::judge(const ReportedHits& reported) const {
  const std::size_t count = rays_->size();
  Tally tally;
  Accuracy& found = tally.found;
  found.rays = count;
  for (Rate* rate : {&found.missed, &found.false_hits, &found.wrong, &found.ties, &found.neighbours})
    rate->of = count;
  for (std::size_t i = 0; i < count; ++i) {
    const bool answered = reported.hit[i] != 0;
    if (hit(i) && inside_[i] != 0) {
      ++found.leaks.of;
      found.leaks.count += answered ? 0 : 1;
    }
    if (hit(i) && !answered) ++found.missed.count;
    if (!hit(i) && answered) ++found.false_hits.count;
    if (hit(i) && answered && !closest_.empty()) judge_hit(reported, i, tally);
  }
  if (closest_.empty()) found.wrong = found.ties = found.neighbours = {};
  found.t_error_ulp = quantiles_of(std::move(tally.error_ulp));
  found.t_error_relative = quantiles_of(std::move(tally.error_relative));
  return found;
}

/// Exact and reported hit of the same ray.
void Truth::judge_hit(const ReportedHits& reported, std::size_t i, Tally& tally) const {
  const exact::Hit& truth = *closest_[i];
  const Ray ray = rays_->batch()[i];
  const PrimitiveRef named{reported.instance_id[i], reported.primitive_id[i]};
  const auto own = named == truth.primitive ? closest_[i] : reference_->of_primitive(ray, named);
  bool right = true;
  if (named != truth.primitive) {
    const bool tie = own && compare(own->at.t, truth.at.t) == 0;
    right = tie || same_place(i, reported.t[i]);
    Rate& rate = tie ? tally.found.ties : right ? tally.found.neighbours : tally.found.wrong;
    ++rate.count;
  }
  if (right) {
    const double error = absolute_error(truth.at.t, reported.t[i]);
    tally.error_ulp.push_back(error / float_ulp(truth.at.t.to_double()));
    tally.error_relative.push_back(error * glm::length(ray.direction) / diagonal_);
  }
  if (own && !reported.t_error.empty()) {
    ++tally.found.covered.of;
    // absolute_error is the smallest double that is not below the error, so this is an exact comparison.
    if (absolute_error(own->at.t, reported.t[i]) <= reported.t_error[i]) ++tally.found.covered.count;
  }
}

/// Whether t leads to the place of the exact hit, as far as floats of the ray's coordinates can tell.
bool Truth::same_place(std::size_t i, double t) const {
  const Ray ray = rays_->batch()[i];
  const exact::Ratio& exact_t = closest_[i]->at.t;
  const double size =
      std::max(max_abs(ray.origin), max_abs(ray.origin + exact_t.to_double() * ray.direction));
  return absolute_error(exact_t, t) * max_abs(ray.direction) <= kFloatStep * size;
}

Rate Truth::other_primitive(const ReportedHits& reported) const {
  Rate rate{0, rays_->size()};
  for (std::size_t i = 0; i < rays_->size(); ++i) {
    const bool same_verdict = hit(i) == (reported.hit[i] != 0);
    const bool same =
        same_verdict && (!hit(i) || PrimitiveRef{reported.instance_id[i], reported.primitive_id[i]} ==
                                        closest_[i]->primitive);
    rate.count += same ? 0 : 1;
  }
  return rate;
}

}  // namespace gridcast::measure
