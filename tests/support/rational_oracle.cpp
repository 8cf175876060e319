#include "tests/support/rational_oracle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <tuple>
#include <utility>

namespace gridcast::test {
namespace {

using Vec = std::array<mpq_class, 3>;

Vec exactly(const Vec3d& v) {
  return {mpq_class(v.x), mpq_class(v.y), mpq_class(v.z)};
}
Vec minus(const Vec& a, const Vec& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
mpq_class inner(const Vec& a, const Vec& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

Vec placed(const Affine& affine, const Vec3f& p) {
  Vec out = exactly(affine.translation);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      out[std::size_t(row)] += mpq_class(affine.linear[column][row]) * mpq_class(double(p[column]));
  return out;
}

bool in_range(const mpq_class& t, const Ray& ray) {
  const bool after = std::isinf(ray.tnear) ? ray.tnear < 0.0 : t >= mpq_class(ray.tnear);
  const bool before = std::isinf(ray.tfar) ? ray.tfar > 0.0 : t <= mpq_class(ray.tfar);
  return after && before;
}

std::optional<RationalHit> meet(const Ray& ray, const std::array<Vec, 3>& p) {
  const Vec a = minus(p[1], p[0]), b = minus(p[2], p[0]);
  const Vec normal{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  const Vec direction = exactly(ray.direction), origin = exactly(ray.origin);
  const mpq_class slope = inner(normal, direction);
  if (slope == 0) return std::nullopt;
  RationalHit hit;
  hit.t = inner(normal, minus(p[0], origin)) / slope;
  if (!in_range(hit.t, ray)) return std::nullopt;
  // The plane is not parallel to the axis left out.
  const std::size_t out = normal[0] != 0 ? 0 : normal[1] != 0 ? 1 : 2;
  const std::size_t i = (out + 1) % 3, j = (out + 2) % 3;
  const mpq_class x = origin[i] + hit.t * direction[i] - p[0][i],
                  y = origin[j] + hit.t * direction[j] - p[0][j];
  const mpq_class area = a[i] * b[j] - a[j] * b[i];
  hit.u = (x * b[j] - y * b[i]) / area;
  hit.v = (a[i] * y - a[j] * x) / area;
  if (hit.u < 0 || hit.v < 0 || hit.u + hit.v > 1) return std::nullopt;
  return hit;
}

}  // namespace

RationalOracle::RationalOracle(std::vector<measure::exact::Mesh> meshes,
                               std::vector<measure::exact::Instance> instances)
    : meshes_(std::move(meshes)), instances_(std::move(instances)) {}

std::vector<RationalHit> RationalOracle::all(const Ray& ray) const {
  std::vector<RationalHit> hits;
  for (const auto& instance : instances_) {
    const auto& mesh = meshes_[instance.mesh];
    for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
      std::array<Vec, 3> corners;
      for (std::size_t c = 0; c < 3; ++c)
        corners[c] = placed(instance.world_from_object, mesh.positions[mesh.triangles[i][c]]);
      auto hit = meet(ray, corners);
      if (!hit) continue;
      hit->primitive = {instance.instance_id, std::uint32_t(i)};
      hits.push_back(std::move(*hit));
    }
  }
  std::sort(hits.begin(), hits.end(), [](const RationalHit& a, const RationalHit& b) {
    const int order = cmp(a.t, b.t);
    return order != 0 ? order < 0
                      : std::tie(a.primitive.instance_id, a.primitive.primitive_id) <
                            std::tie(b.primitive.instance_id, b.primitive.primitive_id);
  });
  return hits;
}

mpq_class to_rational(const measure::exact::Ratio& ratio) {
  const auto rational = [](const measure::exact::Dyadic& value) {
    std::vector<unsigned char> bytes;  // of the magnitude, most significant first
    export_bits(value.mantissa(), std::back_inserter(bytes), 8);
    mpz_class magnitude;
    mpz_import(magnitude.get_mpz_t(), bytes.size(), 1, 1, 1, 0, bytes.data());
    mpq_class number(value.sign() < 0 ? mpz_class(-magnitude) : magnitude);
    if (value.exponent() >= 0)
      mpq_mul_2exp(number.get_mpq_t(), number.get_mpq_t(), mp_bitcnt_t(value.exponent()));
    else
      mpq_div_2exp(number.get_mpq_t(), number.get_mpq_t(), mp_bitcnt_t(-value.exponent()));
    return number;
  };
  return rational(ratio.numerator()) / rational(ratio.denominator());
}

}  // namespace gridcast::test
