// Triangles without a surface: soup, hair, leaves.

#include <cmath>

#include "core/measure/meshes.h"
#include "core/measure/random.h"

namespace gridcast::measure {
namespace {

using mesh::TriangleMesh;

constexpr double kPi = 3.14159265358979323846;

void add_triangle(TriangleMesh& mesh, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const auto first = std::uint32_t(mesh.positions.size());
  mesh.positions.emplace_back(a);
  mesh.positions.emplace_back(b);
  mesh.positions.emplace_back(c);
  mesh.triangles.push_back({first, first + 1, first + 2});
}

constexpr std::uint32_t kStrandSegments = 10;

/// One curved ribbon of 2 kStrandSegments triangles, rooted at `root`.
void add_strand(TriangleMesh& mesh, const Vec3d& root, Random& random) {
  constexpr double kLength = 0.5, kWidth = 0.002;
  const auto first = std::uint32_t(mesh.positions.size());
  const Vec3d side = kWidth * glm::normalize(glm::cross(root, random.direction()));
  const Vec3d wind = 0.15 * random.direction();
  Vec3d at = root, heading = root + 0.3 * random.direction();
  for (std::uint32_t i = 0; i <= kStrandSegments; ++i) {
    const double taper = 1.0 - 0.9 * double(i) / kStrandSegments;
    mesh.positions.emplace_back(at - taper * side);
    mesh.positions.emplace_back(at + taper * side);
    at += kLength / kStrandSegments * glm::normalize(heading);
    heading += wind + Vec3d{0.0, -0.12, 0.0} + 0.1 * random.direction();
  }
  for (std::uint32_t i = 0; i < kStrandSegments; ++i) {
    const std::uint32_t p = first + 2 * i;
    mesh.triangles.push_back({p, p + 1, p + 2});
    mesh.triangles.push_back({p + 1, p + 3, p + 2});
  }
}

}  // namespace

TriangleMesh soup_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed + 20);
  TriangleMesh mesh;
  mesh.name = "soup";
  // As long as two spacings between neighbours: dense enough that a ray meets something after a while.
  const double size = 1.0 / std::cbrt(double(count));
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d center{random.uniform(), random.uniform(), random.uniform()};
    add_triangle(mesh, center + random.in_box(size), center + random.in_box(size),
                 center + random.in_box(size));
  }
  return mesh;
}

TriangleMesh hair_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed + 30);
  TriangleMesh mesh;
  mesh.name = "hair";
  const std::size_t strands = std::max<std::size_t>(1, count / (2 * std::size_t(kStrandSegments)));
  for (std::size_t i = 0; i < strands; ++i) add_strand(mesh, random.direction(), random);
  return mesh;
}

TriangleMesh tree_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed + 40);
  TriangleMesh mesh;
  mesh.name = "tree";
  constexpr int kTrunkSides = 6;
  for (int i = 0; i < kTrunkSides; ++i) {
    const double a = 2.0 * kPi * i / kTrunkSides, b = 2.0 * kPi * (i + 1) / kTrunkSides;
    add_triangle(mesh, {0.06 * std::cos(a), 0.0, 0.06 * std::sin(a)}, {0.0, 1.6, 0.0},
                 {0.06 * std::cos(b), 0.0, 0.06 * std::sin(b)});
  }
  while (mesh.triangle_count() < count) {
    // A cone of leaves: wide below, narrow above.
    const double height = random.uniform();
    const double radius = 0.45 * (1.0 - height) * std::sqrt(random.uniform());
    const double angle = random.uniform(0.0, 2.0 * kPi);
    const Vec3d at{radius * std::cos(angle), 0.4 + 1.3 * height, radius * std::sin(angle)};
    add_triangle(mesh, at + random.in_box(0.05), at + random.in_box(0.05), at + random.in_box(0.05));
  }
  return mesh;
}

TriangleMesh overlapping_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed + 50);
  TriangleMesh mesh;
  mesh.name = "overlapping";
  for (std::size_t i = 0; i < count; ++i) {
    // The third corner lies opposite of the other two, so the triangle passes near the middle.
    const Vec3d a = random.direction(), b = random.direction();
    const Vec3d c = -glm::normalize(a + b + 0.1 * random.direction());
    add_triangle(mesh, a, b, c);
  }
  return mesh;
}

TriangleMesh huge_triangle_mesh(std::size_t count, std::uint64_t seed) {
  TriangleMesh mesh = scan_mesh(count, seed);
  mesh.name = "huge triangle";
  // Slanted, so that its box holds everything; it passes behind the body as the camera sees it.
  add_triangle(mesh, {-60.0, -60.0, -40.0}, {60.0, -60.0, -20.0}, {0.0, 90.0, 38.0});
  return mesh;
}

TriangleMesh fan_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed + 60);
  TriangleMesh mesh;
  mesh.name = "needle fan";
  mesh.positions.emplace_back(0.0F, 0.2F, 0.0F);
  for (std::size_t i = 0; i < count; ++i) {
    const double angle = 2.0 * kPi * double(i) / double(count);
    mesh.positions.emplace_back(std::cos(angle), 0.001 * random.uniform(), std::sin(angle));
  }
  for (std::size_t i = 0; i < count; ++i)
    mesh.triangles.push_back({0, std::uint32_t(1 + (i + 1) % count), std::uint32_t(1 + i)});
  return mesh;
}

TriangleMesh flat_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed + 70);
  TriangleMesh mesh;
  mesh.name = "flat";
  const double size = 2.0 / std::sqrt(double(count));
  const auto near = [&](const Vec3d& at) {
    return Vec3d{at.x + random.uniform(-size, size), 0.0, at.z + random.uniform(-size, size)};
  };
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d at{random.uniform(-1.0, 1.0), 0.0, random.uniform(-1.0, 1.0)};
    add_triangle(mesh, near(at), near(at), near(at));
  }
  return mesh;
}

TriangleMesh needles_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed + 90);
  TriangleMesh mesh;
  mesh.name = "needles";
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d at = random.in_box(1.0), along = random.direction(), aside = random.direction();
    add_triangle(mesh, at + along, at - along, at + along + 0.004 * aside);
  }
  return mesh;
}

}  // namespace gridcast::measure
