#pragma once
// A scene judged by the exact reference of the problem that its numbers pose in the world.

#include <string>
#include <vector>

#include "core/measure/exact/reference.h"
#include "tests/stability/subject.h"
#include "tests/stability/truth.h"
#include "tests/stability/world_triangle.h"

namespace gridcast::stability {

/// `exact` mode must give the reference's closest hit. `robust` decides about the object-space ray: it must
/// have the reference's hits but for those that the way to object space can decide (WorldTriangle), every one
/// of them on its plane within the containment of core/README.md. In both every t is within its t_error of
/// the true one and every normal within its bound of the true one, on the side of the winding, mirrored
/// instances included.
class ExactSubject {
 public:
  explicit ExactSubject(SceneSpec spec);

  [[nodiscard]] const Subject& subject() const { return subject_; }

  /// Asks the closest, any and every hit.
  void judge(Row& row, std::vector<Shot> shots);
  /// For many rays: judge() for the first Subject::kAskedRays, then the closest hit in exact mode as a batch
  /// in one structure after the other, with its t_error.
  void shoot(Row& row, std::vector<Shot> shots);

  struct Seen {
    std::size_t rays = 0;
    std::size_t hits = 0, bounded = 0;  ///< all, and those with a finite t_error
    std::size_t undecided = 0;          ///< rays where the way to object space decided about a hit
    std::size_t reordered = 0;          ///< rays with the same hits, of which robust has another one in front
    std::size_t flipped = 0;            ///< rays that one of the two knows no hit of
    double height = 0.0, normal = 0.0;  ///< largest, in units of what is allowed
    double inverse = 0.0;               ///< WorldTriangle::inverse_roundings of what was hit, the largest

    Seen& operator+=(const Seen& other);
    [[nodiscard]] double bounded_share() const { return hits == 0 ? 0.0 : double(bounded) / double(hits); }
    /// Prints all that.
    void tell(const std::string& what) const;
  };
  [[nodiscard]] const Seen& seen() const { return seen_; }

 private:
  using ExactHits = std::vector<measure::exact::Hit>;

  [[nodiscard]] double mesh_size(std::uint32_t instance_id) const;
  [[nodiscard]] WorldTriangle triangle(const PrimitiveRef& primitive) const;
  void judge_robust(Row& row, const Shot& shot, std::span<const SurfaceHit> got, const ExactHits& exact);
  void judge_t(Row& row, const Shot& shot, const SurfaceHit& hit, const measure::exact::Ratio& t);
  void judge_normal(Row& row, const Shot& shot, const SurfaceHit& hit);
  void judge_exact_batch(Row& row, std::span<const Shot> shots);

  Subject subject_;
  WorldTruth truth_;
  Seen seen_;
  std::size_t judged_ = 0;
};

}  // namespace gridcast::stability
