#pragma once
// Who takes part in the comparison of speed and accuracy: a scene of ours or Embree's, asked in one way.

#include <memory>
#include <string>

#include "core/measure/accuracy.h"
#include "core/measure/embree_yardstick.h"
#include "core/measure/ray_sets.h"
#include "core/scene/scene.h"

namespace gridcast::measure {

class TradeoffMethod {
 public:
  virtual ~TradeoffMethod() = default;

  /// Traces the set on the calling arena and leaves the answers: what is timed. kCancelled when stopped.
  [[nodiscard]] virtual Status trace(const RaySet& rays, const std::stop_token& stop) = 0;
  /// Traces it again, with all that accuracy asks for.
  [[nodiscard]] virtual Result<ReportedHits> answer(const RaySet& rays, const std::stop_token& stop) = 0;
  /// Not timed, before trace().
  virtual void prepare(const RaySet& /*rays*/) {}

  std::string engine, structure, precision, entry;
  double bytes_per_triangle = 0.0;
  double build_s = 0.0;
};

/// Our batch query; `scene` outlives it.
[[nodiscard]] std::unique_ptr<TradeoffMethod> make_our_method(const scene::Scene& scene, Precision precision);
/// Embree's; `scene` outlives it.
[[nodiscard]] std::unique_ptr<TradeoffMethod> make_embree_method(const EmbreeScene& scene, EmbreeMode mode,
                                                                 EmbreeEntry entry);

}  // namespace gridcast::measure
