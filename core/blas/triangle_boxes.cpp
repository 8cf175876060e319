#include "core/blas/triangle_boxes.h"

#include <algorithm>

namespace gridcast::blas {

double triangle_boxes_per_ray(const mesh::TriangleMesh& mesh, const Bounds3f& bounds) {
  constexpr std::size_t kSampledTriangles = 1024;
  const double whole = to_double(bounds).half_area();
  const std::size_t count = mesh.triangle_count();
  if (!(whole > 0.0) || count == 0) return 0.0;
  const std::size_t stride = std::max<std::size_t>(1, count / kSampledTriangles);
  double sum = 0.0;
  std::size_t sampled = 0;
  for (std::size_t i = 0; i < count; i += stride, ++sampled)
    sum += to_double(mesh.triangle_bounds(std::uint32_t(i))).half_area();
  return sum * (double(count) / double(sampled)) / whole;
}

}  // namespace gridcast::blas
