#pragma once
// Every triangle, every ray: the structure of small meshes and the reference of all tests.

#include <memory>
#include <stop_token>

#include "core/blas/blas.h"

namespace gridcast::blas {

class BruteForce {
 public:
  [[nodiscard]] static Result<std::shared_ptr<const BruteForce>> build(const mesh::TriangleMesh& mesh,
                                                                       std::stop_token stop);
  /// Nothing to move: the mesh itself is all there is.
  [[nodiscard]] Result<std::shared_ptr<const BruteForce>> refit(const mesh::TriangleMesh& moved) const;

  template <Precision kPrecision, bool kAnyHit>
  bool intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, Hit& best) const;

  [[nodiscard]] Status validate(const mesh::TriangleMesh& mesh) const;
  void add_stats(StructureStats& stats) const;

 private:
  std::size_t triangle_count_ = 0;
};

}  // namespace gridcast::blas
