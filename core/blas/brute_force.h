#pragma once
// Every triangle, every ray: the structure of small meshes and the reference of all tests.

#include <memory>
#include <stop_token>

#include "core/blas/blas.h"
#include "core/blas/collector.h"
#include "core/blas/point_sink.h"

namespace gridcast::blas {

class BruteForce {
 public:
  [[nodiscard]] static Result<std::shared_ptr<const BruteForce>> build(const mesh::TriangleMesh& mesh,
                                                                       std::stop_token stop);
  /// Nothing to move: the mesh itself is all there is.
  [[nodiscard]] Result<std::shared_ptr<const BruteForce>> refit(const mesh::TriangleMesh& moved) const;

  /// True when an offer narrowed the range or ended the traversal.
  template <Precision kPrecision, Collector C>
  bool intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const;

  /// Offers the triangles around sink.center(); see PointSink.
  void search(const mesh::TriangleMesh& mesh, PointSink& sink) const;

  [[nodiscard]] Status validate(const mesh::TriangleMesh& mesh) const;
  void add_stats(StructureStats& stats) const;

 private:
  std::size_t triangle_count_ = 0;
};

}  // namespace gridcast::blas
