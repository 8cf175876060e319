// Closed bodies and terrain: what scanners and modellers make.

#include <cmath>
#include <functional>
#include <unordered_map>

#include "core/measure/meshes.h"
#include "core/measure/noise.h"
#include "core/measure/random.h"

namespace gridcast::measure {
namespace {

using mesh::TriangleMesh;

/// A closed sphere of 12 n^2 triangles: a cube's faces as n x n quads, blown up.
class CubeSphere {
 public:
  explicit CubeSphere(int n) : n_(n) {
    for (int axis = 0; axis < 3; ++axis)
      for (const int side : {0, n})
        for (int i = 0; i < n; ++i)
          for (int j = 0; j < n; ++j) add_quad(axis, side, i, j);
  }
  [[nodiscard]] const std::vector<mesh::Triangle>& triangles() const { return triangles_; }
  [[nodiscard]] const std::vector<Vec3d>& directions() const { return directions_; }

 private:
  void add_quad(int axis, int side, int i, int j) {
    const auto corner = [&](int a, int b) {
      int at[3];
      at[axis] = side;
      at[(axis + 1) % 3] = a;
      at[(axis + 2) % 3] = b;
      return vertex(at[0], at[1], at[2]);
    };
    const std::uint32_t p = corner(i, j), q = corner(i + 1, j), r = corner(i + 1, j + 1),
                        s = corner(i, j + 1);
    if (side == 0) {
      triangles_.push_back({p, r, q});
      triangles_.push_back({p, s, r});
    } else {
      triangles_.push_back({p, q, r});
      triangles_.push_back({p, r, s});
    }
  }

  std::uint32_t vertex(int x, int y, int z) {
    const auto key = (std::uint64_t(x) << 42) | (std::uint64_t(y) << 21) | std::uint64_t(z);
    const auto [at, is_new] = ids_.try_emplace(key, std::uint32_t(directions_.size()));
    if (is_new) {
      // tan spreads the vertices almost evenly over the sphere.
      const auto place = [&](int i) { return std::tan((2.0 * i / n_ - 1.0) * 0.78539816339744830962); };
      directions_.push_back(glm::normalize(Vec3d{place(x), place(y), place(z)}));
    }
    return at->second;
  }

  int n_;
  std::vector<mesh::Triangle> triangles_;
  std::vector<Vec3d> directions_;
  std::unordered_map<std::uint64_t, std::uint32_t> ids_;
};

TriangleMesh deformed_sphere(std::size_t count, const std::function<Vec3d(const Vec3d&)>& place) {
  const int n = std::max(2, int(std::lround(std::sqrt(double(count) / 12.0))));
  const CubeSphere sphere(n);
  TriangleMesh mesh;
  mesh.triangles = sphere.triangles();
  mesh.positions.reserve(sphere.directions().size());
  for (const Vec3d& direction : sphere.directions()) mesh.positions.emplace_back(place(direction));
  return mesh;
}

struct Lobe {
  Vec3d direction;
  double height, sharpness;
};

std::vector<Lobe> random_lobes(int count, Random& random) {
  std::vector<Lobe> lobes;
  lobes.reserve(std::size_t(count));
  for (int i = 0; i < count; ++i)
    lobes.push_back({random.direction(), random.uniform(0.15, 0.5), random.uniform(4.0, 40.0)});
  return lobes;
}

double lobes_at(const std::vector<Lobe>& lobes, const Vec3d& direction) {
  double sum = 0.0;
  for (const Lobe& lobe : lobes)
    sum += lobe.height * std::exp(lobe.sharpness * (glm::dot(lobe.direction, direction) - 1.0));
  return sum;
}

}  // namespace

TriangleMesh organic_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  const std::vector<Lobe> lobes = random_lobes(9, random);
  TriangleMesh mesh = deformed_sphere(count, [&](const Vec3d& d) {
    return (0.6 + lobes_at(lobes, d) + 0.06 * fractal_noise(3.0 * d, 5, 0.5, seed)) * d;
  });
  mesh.name = "organic";
  return mesh;
}

TriangleMesh scan_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed + 1);
  const std::vector<Lobe> lobes = random_lobes(16, random);
  TriangleMesh mesh = deformed_sphere(count, [&](const Vec3d& d) {
    // Scanners leave vertices where they happened to look: slide them along the surface.
    const Vec3d slide{noise(40.0 * d, seed + 2), noise(40.0 * d, seed + 3), noise(40.0 * d, seed + 4)};
    const Vec3d at = glm::normalize(d + 0.012 * slide);
    const double folds = std::abs(fractal_noise(4.0 * at, 7, 0.55, seed + 5));
    return (0.5 + lobes_at(lobes, at) - 0.12 * folds) * at * Vec3d{0.8, 1.7, 0.7};
  });
  mesh.name = "scan";
  return mesh;
}

TriangleMesh terrain_mesh(std::size_t count, std::uint64_t seed) {
  const int n = std::max(2, int(std::lround(std::sqrt(double(count) / 2.0))));
  TriangleMesh mesh;
  mesh.name = "terrain";
  mesh.positions.reserve(std::size_t(n + 1) * std::size_t(n + 1));
  mesh.triangles.reserve(std::size_t(2 * n) * std::size_t(n));
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; j <= n; ++j) {
      const double x = 2.0 * i / n - 1.0, z = 2.0 * j / n - 1.0;
      const double y = 0.35 * fractal_noise({2.5 * x, 0.5, 2.5 * z}, 9, 0.5, seed + 6);
      mesh.positions.emplace_back(x, y, z);
    }
  }
  const auto id = [&](int i, int j) { return std::uint32_t(i * (n + 1) + j); };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      mesh.triangles.push_back({id(i, j), id(i, j + 1), id(i + 1, j)});
      mesh.triangles.push_back({id(i + 1, j), id(i, j + 1), id(i + 1, j + 1)});
    }
  }
  return mesh;
}

}  // namespace gridcast::measure
