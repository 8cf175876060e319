#include "tests/support/shapes.h"

#include <cmath>
#include <map>
#include <numbers>

#include "tests/support/random.h"

namespace gridcast::test {
namespace {

constexpr double kTau = 2.0 * std::numbers::pi;

void add_triangle(TriangleMesh& mesh, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const auto first = std::uint32_t(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

TriangleMesh icosahedron() {
  const float g = std::numbers::phi_v<float>;
  TriangleMesh mesh;
  mesh.positions = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                    {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  mesh.triangles = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                    {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                    {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  return mesh;
}

void subdivide(TriangleMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
  auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const auto [entry, added] = middles.try_emplace(std::minmax(a, b), std::uint32_t(mesh.positions.size()));
    if (added) mesh.positions.push_back(0.5F * (mesh.positions[a] + mesh.positions[b]));
    return entry->second;
  };
  std::vector<mesh::Triangle> finer;
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
  }
  mesh.triangles = std::move(finer);
}

}  // namespace

TriangleMesh single_triangle() {
  TriangleMesh mesh;
  add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  return mesh;
}

TriangleMesh box(const Vec3f& lower, const Vec3f& upper) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.positions.push_back({(i & 1) != 0 ? upper.x : lower.x, (i & 2) != 0 ? upper.y : lower.y,
                              (i & 4) != 0 ? upper.z : lower.z});
  }
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

TriangleMesh icosphere(int subdivisions, float radius) {
  TriangleMesh mesh = icosahedron();
  for (int i = 0; i < subdivisions; ++i) subdivide(mesh);
  for (Vec3f& p : mesh.positions) p = radius * glm::normalize(p);
  return mesh;
}

TriangleMesh jittered_icosphere(int subdivisions, std::uint64_t seed, float radius) {
  TriangleMesh mesh = icosphere(subdivisions, radius);
  Random random(seed);
  for (Vec3f& p : mesh.positions) p *= float(random.uniform(0.9, 1.1));
  return mesh;
}

TriangleMesh torus(int around, int across, float major, float minor) {
  TriangleMesh mesh;
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      const double a = kTau * i / around, b = kTau * j / across;
      const double r = double(major) + double(minor) * std::cos(b);
      mesh.positions.push_back(
          {float(r * std::cos(a)), float(double(minor) * std::sin(b)), float(r * std::sin(a))});
    }
  }
  auto vertex = [&](int i, int j) { return std::uint32_t((i % around) * across + j % across); };
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < across; ++j) {
      mesh.triangles.push_back({vertex(i, j), vertex(i, j + 1), vertex(i + 1, j)});
      mesh.triangles.push_back({vertex(i + 1, j), vertex(i, j + 1), vertex(i + 1, j + 1)});
    }
  }
  return mesh;
}

TriangleMesh needle_fan(int triangles) {
  TriangleMesh mesh;
  mesh.positions = {{0.1F, 1.F, -0.2F}, {-0.05F, -1.F, 0.1F}};
  const int rim = triangles / 2;
  for (int i = 0; i < rim; ++i) {
    const double a = kTau * i / rim;
    mesh.positions.push_back({float(std::cos(a)), float(0.1 * std::sin(7.0 * a)), float(std::sin(a))});
  }
  for (int i = 0; i < rim; ++i) {
    const auto here = std::uint32_t(2 + i), next = std::uint32_t(2 + (i + 1) % rim);
    mesh.triangles.push_back({0, next, here});
    mesh.triangles.push_back({1, here, next});
  }
  return mesh;
}

TriangleMesh quad_grid(int cells, float size) {
  TriangleMesh mesh;
  const float step = size / float(cells);
  for (int y = 0; y <= cells; ++y)
    for (int x = 0; x <= cells; ++x) mesh.positions.push_back({float(x) * step, float(y) * step, 0.F});
  for (int y = 0; y < cells; ++y) {
    for (int x = 0; x < cells; ++x) {
      const auto a = std::uint32_t(y * (cells + 1) + x), b = a + 1, c = a + std::uint32_t(cells) + 1,
                 d = c + 1;
      mesh.triangles.push_back({a, b, c});
      mesh.triangles.push_back({b, d, c});
    }
  }
  return mesh;
}

TriangleMesh soup(int triangles, std::uint64_t seed, float edge) {
  Random random(seed);
  TriangleMesh mesh;
  for (int i = 0; i < triangles; ++i) {
    const Vec3d center = random.in_box(1.0);
    auto corner = [&] { return Vec3f(center + random.in_box(double(edge))); };
    const Vec3f a = corner(), b = corner(), c = corner();
    add_triangle(mesh, a, b, c);
  }
  return mesh;
}

TriangleMesh slivers(int triangles, std::uint64_t seed, float aspect) {
  Random random(seed);
  TriangleMesh mesh;
  for (int i = 0; i < triangles; ++i) {
    const Vec3d a = random.in_box(1.0);
    const Vec3d along = random.direction();
    const Vec3d side = random.direction() / double(aspect);
    add_triangle(mesh, Vec3f(a), Vec3f(a + along), Vec3f(a + 0.5 * along + side));
  }
  return mesh;
}

TriangleMesh translated(TriangleMesh mesh, const Vec3f& offset) {
  for (Vec3f& p : mesh.positions) p += offset;
  return mesh;
}

TriangleMesh box_city(int blocks, std::uint64_t seed) {
  Random random(seed);
  TriangleMesh city;
  for (int i = 0; i < blocks * blocks; ++i) {
    const Vec3f lower(float(i % blocks) * 2.F, 0.F, float(i / blocks) * 2.F);
    const auto height = float(1 + random.below(6));
    const TriangleMesh house = box(lower, lower + Vec3f(1.5F, height, 1.5F));
    const auto first = std::uint32_t(city.positions.size());
    city.positions.insert(city.positions.end(), house.positions.begin(), house.positions.end());
    for (const auto& [a, b, c] : house.triangles) city.triangles.push_back({a + first, b + first, c + first});
  }
  return city;
}

TriangleMesh voxel_boundary(int n, std::uint64_t seed) {
  Random random(seed);
  std::vector<bool> solid(std::size_t(n) * n * n);
  for (auto&& cell : solid) cell = random.below(2) == 0;
  const auto is_solid = [&](const glm::ivec3& c) {
    for (int axis = 0; axis < 3; ++axis)
      if (c[axis] < 0 || c[axis] >= n) return false;
    return bool(solid[(std::size_t(c.z) * n + c.y) * n + c.x]);
  };
  TriangleMesh mesh;
  const int side = n + 1;
  for (int i = 0; i < side * side * side; ++i)
    mesh.positions.push_back({float(i % side), float(i / side % side), float(i / (side * side))});
  const auto vertex = [&](const glm::ivec3& p) { return std::uint32_t((p.z * side + p.y) * side + p.x); };
  for (int i = 0; i < n * n * n; ++i) {
    const glm::ivec3 cell(i % n, i / n % n, i / (n * n));
    if (!is_solid(cell)) continue;
    for (int axis = 0; axis < 3; ++axis) {
      glm::ivec3 along(0), first(0), second(0);
      along[axis] = first[(axis + 1) % 3] = second[(axis + 2) % 3] = 1;
      for (const int way : {0, 1}) {
        if (is_solid(cell + (way == 0 ? -along : along))) continue;
        const glm::ivec3 corner = cell + way * along;
        const std::uint32_t a = vertex(corner), b = vertex(corner + first),
                            c = vertex(corner + first + second), d = vertex(corner + second);
        mesh.triangles.push_back(way == 1 ? mesh::Triangle{a, b, c} : mesh::Triangle{a, c, b});
        mesh.triangles.push_back(way == 1 ? mesh::Triangle{a, c, d} : mesh::Triangle{a, d, c});
      }
    }
  }
  return mesh;
}

TriangleMesh repeated(const TriangleMesh& mesh, int copies) {
  TriangleMesh all = mesh;
  for (int i = 1; i < copies; ++i)
    for (const mesh::Triangle& triangle : mesh.triangles) all.triangles.push_back(triangle);
  return all;
}

}  // namespace gridcast::test
