#include "core/blas/brute_force.h"

#include "core/blas/cost_model.h"
#include "core/mesh/triangle_test.h"

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

template <Precision kPrecision, bool kAnyHit>
bool BruteForce::intersect(const mesh::TriangleMesh& mesh, const mesh::ObjectRay& ray, Hit& best) const {
  bool replaced = false;
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    const auto [p0, p1, p2] = mesh.corners(id);
    if (!mesh::intersect_primitive<kPrecision>(ray, p0, p1, p2, id, best)) continue;
    if constexpr (kAnyHit) return true;
    replaced = true;
  }
  return replaced;
}

template bool BruteForce::intersect<Precision::kFast, false>(const mesh::TriangleMesh&,
                                                             const mesh::ObjectRay&, Hit&) const;
template bool BruteForce::intersect<Precision::kFast, true>(const mesh::TriangleMesh&, const mesh::ObjectRay&,
                                                            Hit&) const;
template bool BruteForce::intersect<Precision::kRobust, false>(const mesh::TriangleMesh&,
                                                               const mesh::ObjectRay&, Hit&) const;
template bool BruteForce::intersect<Precision::kRobust, true>(const mesh::TriangleMesh&,
                                                              const mesh::ObjectRay&, Hit&) const;

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
