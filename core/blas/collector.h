#pragma once
// What a traversal does with the triangles that a ray meets. A traversal finds candidates, the triangle test
// decides whether the ray meets one, and a collector says what becomes of it.

#include <concepts>
#include <cstdint>
#include <utility>

#include "core/mesh/exact_test.h"
#include "core/mesh/triangle_test.h"

namespace gridcast::blas {

/// What a collector says to a hit that it was offered.
enum class Offer : std::uint8_t {
  kGoOn,      ///< nothing changed for the traversal
  kNarrowed,  ///< tfar() is nearer now
  kDone       ///< no other hit matters
};

/// A traversal offers every triangle that the ray meets at tnear to tfar() at least once. It may offer one
/// several times, since several leaves may hold it, in any order, and with a `hit.t` outside the range, which
/// is the collector's to judge.
///
/// kStopsAtFirst: the first hit in range is as good as any other. The traversal then saves itself the order
/// of its visits, and a hit that is certain without the triangle test is not offered but ends it.
///
/// Candidate: what the triangle test says of a hit, mesh::ExactHit for `exact`, else mesh::TriangleHit.
template <class T>
concept Collector = requires(T& collector, const mesh::ObjectRay& ray, const typename T::Candidate& hit,
                             std::uint32_t id) {
  { T::kStopsAtFirst } -> std::convertible_to<bool>;
  { std::as_const(collector).tfar() } -> std::same_as<double>;
  { collector.offer(ray, hit, id) } -> std::same_as<Offer>;
};

/// Keeps the closest by the tie rule; `best` starts as {tfar}.
struct ClosestHit {
  using Candidate = mesh::TriangleHit;
  static constexpr bool kStopsAtFirst = false;
  Hit& best;

  [[nodiscard]] double tfar() const { return best.t; }
  Offer offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit, std::uint32_t primitive_id) const {
    return mesh::keep_closer(ray, hit, primitive_id, best) ? Offer::kNarrowed : Offer::kGoOn;
  }
};

/// Is content with any.
struct AnyHit {
  using Candidate = mesh::TriangleHit;
  static constexpr bool kStopsAtFirst = true;
  double far;

  [[nodiscard]] double tfar() const { return far; }
  [[nodiscard]] Offer offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit,
                            std::uint32_t primitive_id) const {
    return mesh::in_range(ray, hit, far, primitive_id) ? Offer::kDone : Offer::kGoOn;
  }
};

/// ClosestHit of `exact`: the order of the real numbers, of which intervals are known.
struct ExactClosest {
  using Candidate = mesh::ExactHit;
  static constexpr bool kStopsAtFirst = false;
  mesh::ExactBest& best;

  [[nodiscard]] double tfar() const { return best.upper; }
  Offer offer(const mesh::ObjectRay& ray, const mesh::ExactHit& hit, std::uint32_t primitive_id) const {
    return best.keep_closer(ray, hit, primitive_id) ? Offer::kNarrowed : Offer::kGoOn;
  }
};

/// AnyHit of `exact`.
struct ExactAny {
  using Candidate = mesh::ExactHit;
  static constexpr bool kStopsAtFirst = true;
  double far;

  [[nodiscard]] double tfar() const { return far; }
  [[nodiscard]] Offer offer(const mesh::ObjectRay& ray, const mesh::ExactHit& hit,
                            std::uint32_t primitive_id) const {
    return mesh::in_range(ray, hit, far, primitive_id) ? Offer::kDone : Offer::kGoOn;
  }
};

/// Takes every hit. Behind a virtual call, so that one kernel serves all that lists or counts hits.
class HitSink {
 public:
  using Candidate = mesh::TriangleHit;
  static constexpr bool kStopsAtFirst = false;

  HitSink(const HitSink&) = delete;
  HitSink& operator=(const HitSink&) = delete;
  virtual ~HitSink() = default;

  [[nodiscard]] double tfar() const { return tfar_; }
  virtual Offer offer(const mesh::ObjectRay& ray, const mesh::TriangleHit& hit,
                      std::uint32_t primitive_id) = 0;

 protected:
  explicit HitSink(double tfar) : tfar_(tfar) {}
  void set_tfar(double tfar) { tfar_ = tfar; }

 private:
  double tfar_;
};

/// Decides about a triangle and offers it where the ray meets it.
template <Precision kPrecision, Collector C>
[[gnu::always_inline]] inline Offer test_triangle(const mesh::ObjectRay& ray, const Vec3f& p0,
                                                  const Vec3f& p1, const Vec3f& p2,
                                                  std::uint32_t primitive_id, C& collector) {
  typename C::Candidate hit;
  if constexpr (kPrecision == Precision::kExact) {
    if (!mesh::intersect_triangle_exact(ray, {ray, p0, p1, p2}, primitive_id, hit)) return Offer::kGoOn;
  } else {
    if (!mesh::intersect_triangle<kPrecision>(ray, p0, p1, p2, hit)) return Offer::kGoOn;
  }
  return collector.offer(ray, hit, primitive_id);
}

}  // namespace gridcast::blas
