#pragma once
// How answers to rays compare with the exact ones.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <vector>

#include "core/error.h"
#include "core/measure/exact/reference.h"
#include "core/measure/rate.h"
#include "core/measure/ray_sets.h"
#include "core/scene/scene.h"

namespace gridcast::measure {

/// What somebody answered; row i belongs to ray i. An any-hit query fills `hit` alone.
struct ReportedHits {
  std::vector<std::uint8_t> hit;
  std::vector<double> t;
  std::vector<std::uint32_t> instance_id, primitive_id;
  std::vector<double> t_error;  ///< claimed bounds of |t - exact t|; empty when there are none
};

struct Quantiles {
  double p50 = 0.0, p99 = 0.0, max = 0.0;
};
/// Of values that need not be sorted; nothing for none. p99 is the smallest value that 99 % do not exceed.
[[nodiscard]] std::optional<Quantiles> quantiles_of(std::vector<double> values);

/// Every rate is of all rays, but for leaks and the coverage.
struct Accuracy {
  std::uint64_t rays = 0;
  Rate missed;      ///< exact hit, none reported
  Rate false_hits;  ///< reported, no exact hit
  Rate wrong;       ///< both, but the reported triangle is another one, and at another place
  Rate leaks;       ///< no hit reported, of rays that start inside a closed mesh; unknown without such
  Rate ties;        ///< another triangle, hit at exactly the same t
  /// Another triangle at the same place: t is within one float step of the ray's coordinates. A ray at an
  /// edge that goes to the neighbour. Not an error of the picture, but no exact answer.
  Rate neighbours;
  /// |t - exact t| where both hit and the place is right: in units in the last place of float, and as a share
  /// of the scene's diagonal. None for any hit.
  std::optional<Quantiles> t_error_ulp, t_error_relative;
  /// Claimed bounds that cover the error, of the reported triangles that the ray hits. Unknown without
  /// bounds.
  Rate covered;

  /// What a chart counts as errors: missed, false and wrong.
  [[nodiscard]] Rate errors() const { return {missed.count + false_hits.count + wrong.count, rays}; }
};

/// The exact answers to one set of rays.
class Truth {
 public:
  /// `inside` says of every ray whether it starts inside a closed mesh; empty: none. Keeps `reference` and
  /// `rays`. Parallel. Error: kCancelled.
  [[nodiscard]] static Result<Truth> find(const exact::Reference& reference, const RaySet& rays,
                                          std::vector<std::uint8_t> inside, double diagonal,
                                          const std::stop_token& stop,
                                          const scene::ProgressCallback& progress);

  [[nodiscard]] bool hit(std::size_t ray) const { return hit_[ray] != 0; }
  /// Of closest-hit queries.
  [[nodiscard]] const std::optional<exact::Hit>& closest(std::size_t ray) const { return closest_[ray]; }

  [[nodiscard]] Accuracy judge(const ReportedHits& reported) const;
  /// Rays that are answered with another triangle, a hit instead of a miss or the reverse.
  [[nodiscard]] Rate other_primitive(const ReportedHits& reported) const;

 private:
  struct Tally;
  Truth(const exact::Reference& reference, const RaySet& rays, std::vector<std::uint8_t> inside,
        double diagonal);
  void judge_hit(const ReportedHits& reported, std::size_t i, Tally& tally) const;
  [[nodiscard]] bool same_place(std::size_t i, double t) const;

  const exact::Reference* reference_;
  const RaySet* rays_;
  std::vector<std::uint8_t> inside_;
  double diagonal_;
  std::vector<std::uint8_t> hit_;
  std::vector<std::optional<exact::Hit>> closest_;
};

}  // namespace gridcast::measure
