#include "core/blas/brute_force.h"

#include "core/blas/cost_model.h"

namespace gridcast::blas {

Result<std::shared_ptr<const BruteForce>> BruteForce::build(const mesh::TriangleMesh& mesh,
                                                            std::stop_token /*stop*/) {
  auto made = std::make_shared<BruteForce>();
  made->triangle_count_ = mesh.triangle_count();
  return std::shared_ptr<const BruteForce>(std::move(made));
}

Result<std::shared_ptr<const BruteForce>> BruteForce::refit(const mesh::TriangleMesh& /*moved*/) const {
  return std::make_shared<const BruteForce>(*this);
}

template <Precision kPrecision, Collector C>
bool BruteForce::intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, C& collector) const {
  bool narrowed = false;
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    const auto [p0, p1, p2] = mesh.corners(id);
    const Offer offer = test_triangle<kPrecision>(ray, p0, p1, p2, id, collector);
    if (offer == Offer::kDone) return true;
    narrowed |= offer == Offer::kNarrowed;
  }
  return narrowed;
}

template bool BruteForce::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                      ClosestHit&) const;
template bool BruteForce::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                      AnyHit&) const;
template bool BruteForce::intersect<Precision::kFast>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                      HitSink&) const;
template bool BruteForce::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        ClosestHit&) const;
template bool BruteForce::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        AnyHit&) const;
template bool BruteForce::intersect<Precision::kRobust>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                        HitSink&) const;
template bool BruteForce::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                       ExactClosest&) const;
template bool BruteForce::intersect<Precision::kExact>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                       ExactAny&) const;

void BruteForce::search(const mesh::TriangleMesh& mesh, PointSink& sink) const {
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id)
    if (squared_distance(sink.center(), mesh.triangle_bounds(id)) <= sink.limit()) sink.offer(id);
}

Status BruteForce::validate(const mesh::TriangleMesh& mesh) const {
  if (mesh.triangle_count() == triangle_count_) return ok_status();
  return Error{ErrorCode::kInternal,
               "built for " + std::to_string(triangle_count_) + " triangles, the mesh has " +
                   std::to_string(mesh.triangle_count()),
               "/triangles"};
}

void BruteForce::add_stats(StructureStats& stats) const {
  stats.node_count = 0;
  stats.leaf_count = triangle_count_ > 0 ? 1 : 0;
  stats.reference_count = triangle_count_;
  stats.max_depth = 0;
  stats.memory_bytes = sizeof(BruteForce);
  stats.cost = kTriangleCost * double(triangle_count_);
}

}  // namespace gridcast::blas
