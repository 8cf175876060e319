#include "core/blas/build_reference.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_reduce.h>

namespace gridcast::blas {

SetBounds make_references(const mesh::TriangleMesh& mesh, BuildReference* references) {
  constexpr std::size_t kGrain = 1 << 13;
  auto load = [&](std::uint32_t vertex) {
    const Vec3f& p = mesh.positions[vertex];
    return Float4{p.x, p.y, p.z, 0.F} + broadcast(0.F);  // -0 becomes +0
  };
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, mesh.triangle_count(), kGrain), SetBounds{},
      [&](const tbb::blocked_range<std::size_t>& range, SetBounds bounds) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          const mesh::Triangle& triangle = mesh.triangles[i];
          Box4 box;
          for (const std::uint32_t vertex : triangle) box.extend(load(vertex));
          references[i] = BuildReference::make(box, std::uint32_t(i));
          bounds.extend(references[i]);
        }
        return bounds;
      },
      [](SetBounds a, const SetBounds& b) {
        a.extend(b);
        return a;
      });
}

}  // namespace gridcast::blas
