#include "tests/stability/exact_subject.h"

#include <algorithm>
#include <cmath>
#include <iostream>

#include "core/scene/all_hits.h"
#include "core/scene/hit_error.h"
#include "tests/stability/shot_batch.h"

namespace gridcast::stability {
namespace {

/// The hits of one ray of a list.
std::vector<SurfaceHit> hits_of(const HitLists& lists, std::size_t ray) {
  std::vector<SurfaceHit> hits;
  for (std::size_t k = lists.splits[ray]; k < lists.splits[ray + 1]; ++k) {
    SurfaceHit& hit = hits.emplace_back();
    hit.status = RayStatus::kHit;
    hit.t = lists.hits.t[k];
    hit.instance_id = lists.hits.instance_id[k];
    hit.primitive_id = lists.hits.primitive_id[k];
    hit.mesh_id = lists.hits.mesh_id[k];
    hit.t_error = lists.hits.t_error[k];
  }
  return hits;
}

template <class Hits, class Name>
auto find(const Hits& hits, const PrimitiveRef& primitive, const Name& name) {
  return std::find_if(hits.begin(), hits.end(), [&](const auto& hit) { return name(hit) == primitive; });
}
PrimitiveRef name_of(const SurfaceHit& hit) {
  return {hit.instance_id, hit.primitive_id};
}
PrimitiveRef name_of(const measure::exact::Hit& hit) {
  return hit.primitive;
}

}  // namespace

ExactSubject::ExactSubject(SceneSpec spec) : subject_(std::move(spec)), truth_(subject_.spec()) {}

WorldTriangle ExactSubject::triangle(const PrimitiveRef& primitive) const {
  const scene::Instance instance = subject_.scene().instance(primitive.instance_id);
  return {instance.transform, subject_.scene().blas(instance.mesh_id).mesh().corners(primitive.primitive_id)};
}

double ExactSubject::mesh_size(std::uint32_t instance_id) const {
  const std::uint32_t mesh_id = subject_.scene().instance(instance_id).mesh_id;
  return double(subject_.scene().blas(mesh_id).mesh().bounds().magnitude());
}

void ExactSubject::judge(Row& row, std::vector<Shot> shots) {
  const std::vector<double> rows = rows_of(shots);
  scene::AllHitsOptions all;
  all.fields = HitField::kAll | HitField::kTError;
  const HitLists lists = scene::intersect_all(subject_.scene(), batch_of(rows), all).value();
  std::vector<ExactHits> exact;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const std::vector<SurfaceHit> robust = hits_of(lists, i);
    exact.push_back(truth_.reference().all(shots[i].ray));
    judge_robust(row, shots[i], robust, exact[i]);
    // The closest hit is the first of all.
    shots[i].expected =
        robust.empty() ? Expectation::miss() : Expectation::hit(name_of(robust[0]), robust[0].t);
    shots[i].exact = exact[i].empty() ? Expectation::miss() : exactly(exact[i][0]);
  }
  const Answers answers = subject_.ask(row, shots);
  for (std::size_t i = 0; i < shots.size(); ++i) {
    for (SurfaceHit hit : {answers.robust[i], answers.exact[i]}) {
      if (hit.status != RayStatus::kHit) continue;
      judge_normal(row, shots[i], hit);
      hit.t_error = scene::t_error(subject_.scene(), shots[i].ray, hit);
      const auto one = find(exact[i], name_of(hit), [](const auto& e) { return name_of(e); });
      if (one != exact[i].end()) judge_t(row, shots[i], hit, one->at.t);
    }
  }
  seen_.rays += shots.size();
}

void ExactSubject::shoot(Row& row, std::vector<Shot> shots) {
  if (judged_ >= Subject::kAskedRays) return judge_exact_batch(row, shots);
  judged_ += shots.size();
  judge(row, std::move(shots));
}

void ExactSubject::judge_exact_batch(Row& row, std::span<const Shot> shots) {
  const std::vector<double> rows = rows_of(shots);
  scene::TraceOptions options;
  options.precision = Precision::kExact;
  options.fields = HitField::kInstanceId | HitField::kPrimitiveId | HitField::kTError;
  const HitColumns got = scene::intersect(subject_.next_structure(), batch_of(rows), options).value();
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const auto want = truth_.reference().closest(shots[i].ray);
    SurfaceHit hit;
    hit.status = got.status[i];
    hit.t = got.t[i];
    hit.instance_id = got.instance_id[i];
    hit.primitive_id = got.primitive_id[i];
    hit.t_error = got.t_error[i];
    if ((hit.status == RayStatus::kHit) != want.has_value() || (want && name_of(hit) != want->primitive))
      row.fail(subject_.spec(), shots[i], "exact, batch answers " + describe(hit));
    else if (want)
      judge_t(row, shots[i], hit, want->at.t);
  }
  row.count(shots.size(), shots.size());
  seen_.rays += shots.size();
}

/// Of the hits that only one of the two has each must be one that the way to object space can decide.
void ExactSubject::judge_robust(Row& row, const Shot& shot, std::span<const SurfaceHit> got,
                                const ExactHits& exact) {
  std::size_t undecided = 0;
  const auto alone = [&](const PrimitiveRef& primitive, double t, const std::string& what) {
    ++undecided;
    if (!triangle(primitive).is_undecided(shot.ray, t, mesh_size(primitive.instance_id)))
      row.fail(subject_.spec(), shot,
               what + " hit of instance " + std::to_string(primitive.instance_id) + " primitive " +
                   std::to_string(primitive.primitive_id) + " at t " + std::to_string(t));
  };
  for (const measure::exact::Hit& hit : exact)
    if (find(got, hit.primitive, [](const auto& g) { return name_of(g); }) == got.end())
      alone(hit.primitive, hit.at.t.to_double(), "robust loses a");
  for (const SurfaceHit& hit : got) {
    const auto one = find(exact, name_of(hit), [](const auto& e) { return name_of(e); });
    if (one == exact.end()) {
      alone(name_of(hit), hit.t, "robust has a false");
      continue;
    }
    judge_t(row, shot, hit, one->at.t);
    const double off = measure::exact::absolute_error(one->at.t, hit.t);
    const double share =
        triangle(name_of(hit)).height_share(shot.ray, hit.t, off, mesh_size(hit.instance_id));
    seen_.height = std::max(seen_.height, share);
    if (!(share <= 1.0)) row.fail(subject_.spec(), shot, "a robust hit is off its plane: " + describe(hit));
  }
  const bool reordered =
      !got.empty() && !exact.empty() && undecided == 0 && name_of(got[0]) != name_of(exact[0]);
  seen_.undecided += std::size_t(undecided > 0);
  seen_.reordered += std::size_t(reordered);
  seen_.flipped += std::size_t(got.empty() != exact.empty());
}

void ExactSubject::judge_t(Row& row, const Shot& shot, const SurfaceHit& hit,
                           const measure::exact::Ratio& t) {
  ++seen_.hits;
  seen_.bounded += std::size_t(std::isfinite(hit.t_error));
  if (!(measure::exact::absolute_error(t, hit.t) <= hit.t_error))
    row.fail(subject_.spec(), shot, "t is off by more than its bound: " + describe(hit));
}

void ExactSubject::judge_normal(Row& row, const Shot& shot, const SurfaceHit& hit) {
  const WorldTriangle placed = triangle(name_of(hit));
  const double share = placed.normal_share(hit.normal);
  seen_.inverse = std::max(seen_.inverse, placed.inverse_roundings());
  seen_.normal = std::max(seen_.normal, share);
  if (!(share <= 1.0))
    row.fail(subject_.spec(), shot, "the normal is off or on the other side: " + describe(hit));
}

ExactSubject::Seen& ExactSubject::Seen::operator+=(const Seen& other) {
  rays += other.rays;
  hits += other.hits;
  bounded += other.bounded;
  undecided += other.undecided;
  reordered += other.reordered;
  flipped += other.flipped;
  height = std::max(height, other.height);
  normal = std::max(normal, other.normal);
  inverse = std::max(inverse, other.inverse);
  return *this;
}

void ExactSubject::Seen::tell(const std::string& what) const {
  std::cout << what << ": " << hits << " hits, " << bounded << " with a bound of t; in robust mode "
            << undecided << " of " << rays << " rays decided on the way to object space, " << reordered
            << " with another hit in front, " << flipped
            << " hit or missed otherwise; of what is allowed, planes " << height << ", normals " << normal
            << "; inverses off by " << inverse << " roundings\n";
}

}  // namespace gridcast::stability
