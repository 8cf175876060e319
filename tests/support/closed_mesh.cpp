#include "tests/support/closed_mesh.h"

#include <cmath>
#include <numbers>

namespace gridcast::test {
namespace {

constexpr std::size_t kOrigins = 16;

}  // namespace

double winding_number(const mesh::TriangleMesh& mesh, const Vec3d& p) {
  double sum = 0.0;
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    const auto corners = mesh.corners(id);
    const Vec3d a = Vec3d(corners[0]) - p;
    const Vec3d b = Vec3d(corners[1]) - p;
    const Vec3d c = Vec3d(corners[2]) - p;
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    const double volume = glm::dot(a, glm::cross(b, c));
    sum += std::atan2(volume, la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb);
  }
  return sum / (2.0 * std::numbers::pi);
}

ClosedPlacement::ClosedPlacement(const mesh::TriangleMesh& mesh, double offset, std::uint64_t seed)
    : mesh_(mesh), transform_(Affine{Mat3d(1.0), Vec3d(offset, -offset, offset)}) {
  Random random(seed);
  const double size = max_abs(to_double(mesh.bounds()).extent());
  // Below a thousand doubles across, the world cannot tell the mesh's points apart.
  if (size < 0x1p-42 * std::abs(offset)) return;
  for (int attempt = 0; attempt < 400 && origins_.size() < kOrigins; ++attempt) {
    const auto corners = mesh.corners(random.below(std::uint32_t(mesh.triangle_count())));
    const Vec3d a(corners[0]), b(corners[1]), c(corners[2]);
    const Vec3d normal = glm::cross((b - a) / size, (c - a) / size);
    const double length = glm::length(normal);
    if (!(length > 0.0)) continue;
    const double depth = size * std::pow(10.0, random.uniform(-7.0, -0.5)) * (attempt % 4 == 0 ? 1.0 : -1.0);
    const Vec3d world = transform_.world_from_object().point((a + b + c) / 3.0 + depth * (normal / length));
    // The rounded point is what the ray starts from, so that is what has to be inside.
    const double winding = winding_number(mesh, transform_.point_to_object(world));
    if (std::abs(winding) > 0.9 && std::abs(winding - std::round(winding)) < 0.01) origins_.push_back(world);
  }
}
Ray ClosedPlacement::world_ray(Aim aim, Random& random) const {
  const Vec3d& origin = origins_[random.below(std::uint32_t(origins_.size()))];
  for (;;) {
    const auto corners = mesh_.corners(random.below(std::uint32_t(mesh_.triangle_count())));
    const std::uint32_t i = random.below(3);
    const Vec3d a(corners[i]), b(corners[(i + 1) % 3]);
    const double s = aim == Aim::kVertex ? 0.0 : random.uniform();
    const Vec3d direction = transform_.world_from_object().point(a + s * (b - a)) - origin;
    if (direction == Vec3d(0.0)) continue;
    return {origin, direction};
  }
}

Ray ClosedPlacement::object_ray(Aim aim, Random& random) const {
  const Ray world = world_ray(aim, random);
  return {transform_.point_to_object(world.origin), transform_.vector_to_object(world.direction)};
}

}  // namespace gridcast::test
