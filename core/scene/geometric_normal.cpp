// Compiled once per instruction set and chosen at run time by Highway. The one and the eight take the same
// steps in the same order, so their bits agree; fused are only the products that are without error so.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE \
  "core/scene/geometric_normal.cpp"  // NOLINT: Highway includes this file once per target

#include "core/scene/geometric_normal.h"

#include <cmath>

#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "core/math/exact.h"
#include "core/math/exact_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace gridcast::scene::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Lanes = NormalBatch::Lanes;
using D = hn::CappedTag<double, NormalBatch::kSize>;
using V = hn::Vec<D>;

/// InstanceTransform::normal_to_world of the cross products of the edges. NaN where the product is 0.
void make_normals(const std::array<Lanes, 6>& edges, const std::array<Lanes, 9>& object_from_world,
                  std::array<Lanes, 3>& normals) {
  const D d;
  for (std::size_t i = 0; i < NormalBatch::kSize; i += hn::Lanes(d)) {
    const auto edge = [&](std::size_t k) HWY_ATTR { return hn::Load(d, edges[k].data() + i); };
    const V ax = edge(0), ay = edge(1), az = edge(2), bx = edge(3), by = edge(4), bz = edge(5);
    const V x = gridcast::HWY_NAMESPACE::difference_of_products(d, ay, bz, az, by);
    const V y = gridcast::HWY_NAMESPACE::difference_of_products(d, az, bx, ax, bz);
    const V z = gridcast::HWY_NAMESPACE::difference_of_products(d, ax, by, ay, bx);
    const auto along = [&](std::size_t axis) HWY_ATTR {
      const auto entry = [&](std::size_t row)
                             HWY_ATTR { return hn::Load(d, object_from_world[3 * axis + row].data() + i); };
      return hn::Add(hn::Add(hn::Mul(entry(0), x), hn::Mul(entry(1), y)), hn::Mul(entry(2), z));
    };
    const V wx = along(0), wy = along(1), wz = along(2);
    const V square = hn::Add(hn::Add(hn::Mul(wx, wx), hn::Mul(wy, wy)), hn::Mul(wz, wz));
    const V inverse_length = hn::Div(hn::Set(d, 1.0), hn::Sqrt(square));
    hn::Store(hn::Mul(wx, inverse_length), d, normals[0].data() + i);
    hn::Store(hn::Mul(wy, inverse_length), d, normals[1].data() + i);
    hn::Store(hn::Mul(wz, inverse_length), d, normals[2].data() + i);
  }
}

/// Of one: the cross product of two edges, accurate to the sign.
Vec3d cross_product(const Vec3d& a, const Vec3d& b) {
  using gridcast::difference_of_products;
  return {difference_of_products(a.y, b.z, a.z, b.y), difference_of_products(a.z, b.x, a.x, b.z),
          difference_of_products(a.x, b.y, a.y, b.x)};
}

}  // namespace gridcast::scene::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace gridcast::scene {
namespace {

HWY_EXPORT(make_normals);
HWY_EXPORT(cross_product);

Vec3d facing(const Ray& ray) {
  return -glm::normalize(ray.direction / max_abs(ray.direction));
}

}  // namespace

Vec3d geometric_normal(const Scene& scene, const Hit& hit, const Ray& ray) {
  const Instance instance = scene.instance(hit.instance_id);
  const auto corners = scene.blas(instance.mesh_id).corners(hit);
  const Vec3d p0(corners[0]);
  const Vec3d normal = HWY_DYNAMIC_DISPATCH(cross_product)(Vec3d(corners[1]) - p0, Vec3d(corners[2]) - p0);
  return max_abs(normal) > 0.0 ? instance.transform.normal_to_world(normal) : facing(ray);
}

void NormalBatch::set(std::size_t lane, const Hit& hit, const Ray& ray) {
  const Instance instance = scene_.instance(hit.instance_id);
  const auto corners = scene_.blas(instance.mesh_id).corners(hit);
  const Vec3d p0(corners[0]);
  const Vec3d a = Vec3d(corners[1]) - p0, b = Vec3d(corners[2]) - p0;
  for (int axis = 0; axis < 3; ++axis) {
    edges_[std::size_t(axis)][lane] = a[axis];
    edges_[std::size_t(axis) + 3][lane] = b[axis];
  }
  ray_[lane] = &ray;
  if (instance_[lane] == hit.instance_id) return;
  instance_[lane] = hit.instance_id;
  const Mat3d& linear = instance.transform.object_from_world_linear();
  for (int k = 0; k < 9; ++k) object_from_world_[std::size_t(k)][lane] = linear[k / 3][k % 3];
}

void NormalBatch::make() {
  HWY_DYNAMIC_DISPATCH(make_normals)(edges_, object_from_world_, normal_);
  for (std::size_t lane = 0; lane < kSize; ++lane) {
    if (!std::isnan(normal_[0][lane]) || ray_[lane] == nullptr) continue;
    const Vec3d face = facing(*ray_[lane]);
    for (int axis = 0; axis < 3; ++axis) normal_[std::size_t(axis)][lane] = face[axis];
  }
}

}  // namespace gridcast::scene
#endif  // HWY_ONCE
