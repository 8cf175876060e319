#include "core/measure/answers.h"

#include <cmath>
#include <cstring>

#include "core/scene/trace.h"

namespace gridcast::measure {
namespace {

/// Embree's t is a float and its hits may lie on the neighbour's edge.
constexpr double kLooseT = 1e-3;

template <class T>
bool same_row(const Column<T>& a, const Column<T>& b, std::size_t row, std::size_t width) {
  return std::memcmp(a.data() + row * width, b.data() + row * width, width * sizeof(T)) == 0;
}

bool same_hit(const HitColumns& a, const HitColumns& b, std::size_t i) {
  return a.status[i] == b.status[i] && same_row(a.t, b.t, i, 1) && same_row(a.uv, b.uv, i, 2) &&
         same_row(a.normal, b.normal, i, 3) && a.instance_id[i] == b.instance_id[i] &&
         a.mesh_id[i] == b.mesh_id[i] && a.primitive_id[i] == b.primitive_id[i];
}

}  // namespace

void Answers::resize(std::size_t count, QueryKind query) {
  if (query == QueryKind::kAny)
    occluded.assign(count, RayStatus::kMiss);
  else
    hits.resize(count, HitField::kAll);
}

std::uint64_t count_differences(const Answers& a, const Answers& b) {
  const std::size_t count = a.status().size();
  if (b.status().size() != count) return std::max(count, b.status().size());
  std::uint64_t differences = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const bool same = a.occluded.empty() ? same_hit(a.hits, b.hits, i) : a.occluded[i] == b.occluded[i];
    differences += same ? 0 : 1;
  }
  return differences;
}

std::uint64_t count_differences(const Answers& ours, const EmbreeAnswers& embree) {
  std::uint64_t differences = 0;
  for (std::size_t i = 0; i < ours.status().size(); ++i) {
    const bool hit = ours.status()[i] == RayStatus::kHit;
    if (hit != (embree.hit[i] != 0)) {
      ++differences;
    } else if (hit && ours.occluded.empty()) {
      const double t = ours.hits.t[i];
      if (!(std::abs(t - double(embree.t[i])) <= kLooseT * std::abs(t))) ++differences;
    }
  }
  return differences;
}

std::uint64_t count_hits(const Answers& answers) {
  std::uint64_t hits = 0;
  for (const RayStatus status : answers.status()) hits += status == RayStatus::kHit ? 1 : 0;
  return hits;
}

void trace_single(const scene::Scene& scene, const RaySet& rays, Precision precision, std::size_t begin,
                  std::size_t end, Answers& answers) {
  const RayBatch batch = rays.batch();
  if (query_of(rays.kind) == QueryKind::kAny) {
    for (std::size_t i = begin; i < end; ++i)
      answers.occluded[i] = scene::occluded(scene, batch[i], precision);
  } else {
    for (std::size_t i = begin; i < end; ++i)
      answers.hits.set(i, scene::intersect(scene, batch[i], precision));
  }
}

SampleCheck check_sample(const scene::Scene& brute_force, const RaySet& rays, Precision precision,
                         std::size_t sample, const Answers& answers) {
  SampleCheck check;
  if (rays.size() == 0) return check;
  Answers exact;
  exact.resize(rays.size(), query_of(rays.kind));
  const std::size_t stride = std::max<std::size_t>(1, rays.size() / std::max<std::size_t>(1, sample));
  for (std::size_t i = 0; i < rays.size() && check.rays < sample; i += stride) {
    trace_single(brute_force, rays, precision, i, i + 1, exact);
    const bool same = answers.occluded.empty() ? same_hit(exact.hits, answers.hits, i)
                                               : exact.occluded[i] == answers.occluded[i];
    ++check.rays;
    check.differs += same ? 0 : 1;
  }
  return check;
}

}  // namespace gridcast::measure
