#include "core/measure/tradeoff_method.h"

#include <algorithm>
#include <optional>
#include <utility>

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include "core/math/precision_names.h"
#include "core/scene/trace.h"

namespace gridcast::measure {
namespace {

namespace tbb = oneapi::tbb;

/// Rays per task of Embree's loops; the stop token is looked at between tasks.
constexpr std::size_t kRaysPerTask = 4096;

std::vector<std::uint8_t> hits_of(const std::vector<RayStatus>& status) {
  std::vector<std::uint8_t> hit(status.size());
  for (std::size_t i = 0; i < status.size(); ++i) hit[i] = status[i] == RayStatus::kHit ? 1 : 0;
  return hit;
}

class OurMethod final : public TradeoffMethod {
 public:
  OurMethod(const scene::Scene& scene, Precision how) : scene_(scene), precision_(how) {
    engine = "gridcast";
    precision = to_string(how);
    entry = "batch";
  }

  Status trace(const RaySet& rays, const std::stop_token& stop) override {
    return query(rays, {precision_, HitField::kAll, stop, {}});
  }

  Result<ReportedHits> answer(const RaySet& rays, const std::stop_token& stop) override {
    const HitField fields = HitField::kInstanceId | HitField::kPrimitiveId | HitField::kTError;
    if (Status status = query(rays, {precision_, fields, stop, {}}); !status) return status.error();
    ReportedHits reported;
    if (query_of(rays.kind) == QueryKind::kAny) {
      reported.hit = hits_of(occluded_);
      return reported;
    }
    reported.hit = hits_of(hits_.status);
    reported.t.assign(hits_.t.begin(), hits_.t.end());
    reported.instance_id.assign(hits_.instance_id.begin(), hits_.instance_id.end());
    reported.primitive_id.assign(hits_.primitive_id.begin(), hits_.primitive_id.end());
    reported.t_error.assign(hits_.t_error.begin(), hits_.t_error.end());
    return reported;
  }

 private:
  Status query(const RaySet& rays, const scene::TraceOptions& options) {
    if (query_of(rays.kind) == QueryKind::kAny) {
      auto found = scene::occluded(scene_, rays.batch(), options);
      if (!found) return found.error();
      occluded_ = *std::move(found);
    } else {
      auto found = scene::intersect(scene_, rays.batch(), options);
      if (!found) return found.error();
      hits_ = *std::move(found);
    }
    return ok_status();
  }

  const scene::Scene& scene_;
  Precision precision_;
  HitColumns hits_;
  std::vector<RayStatus> occluded_;
};

class EmbreeMethod final : public TradeoffMethod {
 public:
  EmbreeMethod(const EmbreeScene& scene, EmbreeMode mode, EmbreeEntry how) : scene_(scene), entry_(how) {
    engine = "embree";
    structure = "embree_native";
    precision = to_string(mode);
    entry = to_string(how);
  }

  void prepare(const RaySet& rays) override {
    if (!answers_ || answers_->hit.size() != rays.size()) answers_.emplace(rays.size());
  }

  Status trace(const RaySet& rays, const std::stop_token& stop) override {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, rays.size(), kRaysPerTask),
        [&](const tbb::blocked_range<std::size_t>& range) {
          if (!stop.stop_requested())
            scene_.trace(rays.rows, range.begin(), range.end(), query_of(rays.kind), entry_, *answers_);
        },
        tbb::simple_partitioner());
    if (stop.stop_requested()) return Error{ErrorCode::kCancelled, "the measurement was stopped", ""};
    return ok_status();
  }

  Result<ReportedHits> answer(const RaySet& rays, const std::stop_token& stop) override {
    prepare(rays);
    if (Status status = trace(rays, stop); !status) return status.error();
    ReportedHits reported;
    reported.hit = answers_->hit;
    if (query_of(rays.kind) == QueryKind::kAny) return reported;
    reported.t.assign(answers_->t.begin(), answers_->t.end());
    reported.instance_id = answers_->instance_id;
    // A scene of one mesh in its place has no instances for Embree.
    std::replace(reported.instance_id.begin(), reported.instance_id.end(), kInvalidId, 0U);
    reported.primitive_id = answers_->primitive_id;
    return reported;
  }

 private:
  const EmbreeScene& scene_;
  EmbreeEntry entry_;
  std::optional<EmbreeAnswers> answers_;
};

}  // namespace

std::unique_ptr<TradeoffMethod> make_our_method(const scene::Scene& scene, Precision precision) {
  return std::make_unique<OurMethod>(scene, precision);
}

std::unique_ptr<TradeoffMethod> make_embree_method(const EmbreeScene& scene, EmbreeMode mode,
                                                   EmbreeEntry entry) {
  return std::make_unique<EmbreeMethod>(scene, mode, entry);
}

}  // namespace gridcast::measure
