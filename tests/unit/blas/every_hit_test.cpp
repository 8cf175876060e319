// Every structure offers a sink every hit in range that brute force finds, and nothing else.

#include <algorithm>
#include <bit>
#include <vector>

#include <gtest/gtest.h>

#include "core/blas/blas.h"
#include "core/blas/collector.h"
#include "tests/unit/blas/cases.h"

namespace gridcast::blas {
namespace {

/// Keeps what is in range; says that it is done after `enough` offers in range.
class Recorder : public HitSink {
 public:
  explicit Recorder(double tfar, std::size_t enough = ~std::size_t(0)) : HitSink(tfar), enough_(enough) {}

  Offer offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit, std::uint32_t primitive_id) override {
    if (!mesh::in_range(ray, hit, tfar(), primitive_id)) return Offer::kGoOn;
    hits_.push_back({hit.t, hit.u, hit.v, ray.instance_id, primitive_id});
    return hits_.size() < enough_ ? Offer::kGoOn : Offer::kDone;
  }
  /// In order, each once.
  [[nodiscard]] std::vector<Hit> hits() const {
    std::vector<Hit> sorted = hits_;
    std::sort(sorted.begin(), sorted.end(), closer);
    const auto same = [](const Hit& a, const Hit& b) { return a.primitive_id == b.primitive_id; };
    sorted.erase(std::unique(sorted.begin(), sorted.end(), same), sorted.end());
    return sorted;
  }
  [[nodiscard]] std::size_t offers() const { return hits_.size(); }

 private:
  std::size_t enough_;
  std::vector<Hit> hits_;
};

/// Keeps the nearest hit alone, narrowing the range as it goes.
class Nearest : public HitSink {
 public:
  explicit Nearest(double tfar) : HitSink(tfar), best_{.t = tfar} {}

  Offer offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit, std::uint32_t primitive_id) override {
    if (!mesh::keep_closer(ray, hit, primitive_id, best_)) return Offer::kGoOn;
    set_tfar(best_.t);
    return Offer::kNarrowed;
  }
  [[nodiscard]] const Hit& best() const { return best_; }

 private:
  Hit best_;
};

template <Precision kPrecision>
void offer_all(const Blas& blas, const RayCase& ray, HitSink& sink) {
  mesh::ObjectRay prepared;
  if (!prepared.prepare(ray.ray, blas.bounds())) return;
  prepared.excluded_primitive = ray.excluded;
  blas.intersect_every<kPrecision>(prepared, sink);
}

bool same(const Hit& a, const Hit& b) {
  const auto bits = [](double x) { return std::bit_cast<std::uint64_t>(x); };
  return a.primitive_id == b.primitive_id && bits(a.t) == bits(b.t) && bits(a.u) == bits(b.u) &&
         bits(a.v) == bits(b.v);
}

class EveryHit : public testing::TestWithParam<StructureCase> {
 protected:
  template <Precision kPrecision>
  void compare_with_brute_force() {
    constexpr int kRays = 400;
    for (const MeshCase& mesh_case : mesh_cases()) {
      SCOPED_TRACE(mesh_case.name);
      const Blas brute_force = Blas::build(mesh_case.mesh, {StructureKind::kBruteForce}).value();
      const Blas blas = Blas::build(mesh_case.mesh, GetParam().options).value();
      RayMaker maker(*mesh_case.mesh, test::seed_or(41));
      std::size_t hits = 0;
      for (int i = 0; i < kRays; ++i) {
        const RayCase ray = maker.any();
        Recorder want(ray.ray.tfar), got(ray.ray.tfar);
        offer_all<kPrecision>(brute_force, ray, want);
        offer_all<kPrecision>(blas, ray, got);
        const std::vector<Hit> expected = want.hits(), found = got.hits();
        ASSERT_EQ(found.size(), expected.size()) << "ray " << i;
        for (std::size_t k = 0; k < found.size(); ++k)
          ASSERT_TRUE(same(found[k], expected[k])) << "ray " << i << ", hit " << k;
        hits += found.size();

        Nearest nearest(ray.ray.tfar);
        offer_all<kPrecision>(blas, ray, nearest);
        ASSERT_TRUE(same(nearest.best(), closest<kPrecision>(brute_force, ray))) << "ray " << i;
        if (expected.empty()) continue;
        Recorder first(ray.ray.tfar, 1);
        offer_all<kPrecision>(blas, ray, first);
        ASSERT_EQ(first.offers(), 1U) << "ray " << i << ": went on after the sink was done";
      }
      EXPECT_GT(hits, std::size_t(kRays) / 20) << "too few hits to mean anything";
    }
  }
};

TEST_P(EveryHit, robust_hits_are_those_of_brute_force) {
  compare_with_brute_force<Precision::kRobust>();
}

TEST_P(EveryHit, fast_hits_are_those_of_brute_force) {
  compare_with_brute_force<Precision::kFast>();
}

INSTANTIATE_TEST_SUITE_P(Structures, EveryHit, testing::ValuesIn(structure_cases()),
                         [](const auto& structure) { return structure.param.name; });

}  // namespace
}  // namespace gridcast::blas
