// The hall: architecture, whose long thin triangles and large quads are hard on boxes.

#include <array>
#include <cmath>

#include "core/measure/meshes.h"
#include "core/measure/random.h"

namespace gridcast::measure {
namespace {

using mesh::TriangleMesh;

constexpr double kTwoPi = 6.28318530717958647692;
constexpr Vec3d kHall{40.0, 10.0, 16.0};
constexpr int kPillarRows = 6, kPillarColumns = 16, kMouldingRings = 10;

void add_quad(TriangleMesh& mesh, const std::array<Vec3d, 4>& corners) {
  const auto first = std::uint32_t(mesh.positions.size());
  for (const Vec3d& corner : corners) mesh.positions.emplace_back(corner);
  mesh.triangles.push_back({first, first + 1, first + 2});
  mesh.triangles.push_back({first, first + 2, first + 3});
}

/// A ring of a tube: a circle around `center`, seen along `axis`, turned by `turn` of a whole turn.
struct Ring {
  Vec3d center;
  double radius;
  double turn;
};

/// The mantle between two rings: `sides` quads that run all the way.
void add_mantle(TriangleMesh& mesh, const Ring& from, const Ring& to, const Vec3d& axis, int sides) {
  const Vec3d helper = std::abs(axis.x) < 0.7 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
  const Vec3d a = glm::normalize(glm::cross(axis, helper)), b = glm::cross(axis, a);
  const auto first = std::uint32_t(mesh.positions.size());
  for (int i = 0; i < sides; ++i) {
    for (const Ring& ring : {from, to}) {
      const double angle = kTwoPi * (double(i) / sides + ring.turn);
      mesh.positions.emplace_back(ring.center + ring.radius * (std::cos(angle) * a + std::sin(angle) * b));
    }
  }
  for (int i = 0; i < sides; ++i) {
    const std::uint32_t p = first + std::uint32_t(2 * i), q = first + std::uint32_t(2 * ((i + 1) % sides));
    mesh.triangles.push_back({p, q, p + 1});
    mesh.triangles.push_back({p + 1, q, q + 1});
  }
}

/// A moulding of many small triangles: rings of changing radius.
void add_moulding(TriangleMesh& mesh, const Vec3d& foot, double height, double turn, int sides, int rings) {
  const auto ring = [&](int i) {
    const double part = double(i) / rings;
    return Ring{foot + Vec3d{0.0, part * height, 0.0}, 0.45 + 0.2 * std::abs(std::sin(7.0 * part)), turn};
  };
  for (int i = 0; i < rings; ++i) add_mantle(mesh, ring(i), ring(i + 1), {0, 1, 0}, sides);
}

/// Base, shaft and capital. The shaft is of long thin triangles; a twisted one narrows to a waist, its
/// triangles lean and their boxes overlap.
void add_pillar(TriangleMesh& mesh, const Vec3d& foot, double twist, int sides) {
  const Vec3d up{0, 1, 0};
  const auto at = [&](double height) { return foot + height * up; };
  add_moulding(mesh, foot, 0.8, 0.0, sides, kMouldingRings);
  add_mantle(mesh, {at(0.8), 0.4, 0.0}, {at(8.6), 0.4, twist}, up, sides);
  add_moulding(mesh, at(8.6), 0.8, twist, sides, kMouldingRings);
}

void add_walls(TriangleMesh& mesh) {
  const double x = kHall.x, y = kHall.y, z = kHall.z;
  add_quad(mesh, {{{0, 0, 0}, {0, 0, z}, {x, 0, z}, {x, 0, 0}}});
  add_quad(mesh, {{{0, y, 0}, {x, y, 0}, {x, y, z}, {0, y, z}}});
  add_quad(mesh, {{{0, 0, 0}, {x, 0, 0}, {x, y, 0}, {0, y, 0}}});
  add_quad(mesh, {{{0, 0, z}, {0, y, z}, {x, y, z}, {x, 0, z}}});
  add_quad(mesh, {{{0, 0, 0}, {0, y, 0}, {0, y, z}, {0, 0, z}}});
  add_quad(mesh, {{{x, 0, 0}, {x, 0, z}, {x, y, z}, {x, y, 0}}});
}

/// A thin rod from one point to another: a tube of six sides.
void add_rod(TriangleMesh& mesh, const Vec3d& from, const Vec3d& to, double radius) {
  add_mantle(mesh, {from, radius, 0.0}, {to, radius, 0.0}, glm::normalize(to - from), 6);
}

}  // namespace

TriangleMesh hall_mesh(std::size_t count, std::uint64_t seed) {
  Random random(seed + 10);
  TriangleMesh mesh;
  mesh.name = "hall";
  add_walls(mesh);
  const std::size_t rods = count / 200;
  const std::size_t for_pillars = count - std::min(count, 12 * rods + mesh.triangle_count());
  const int mantles = kPillarRows * kPillarColumns * (2 * kMouldingRings + 1);
  const int sides = std::max(3, int(for_pillars / std::size_t(2 * mantles)));
  for (int row = 0; row < kPillarRows; ++row) {
    for (int column = 0; column < kPillarColumns; ++column) {
      const Vec3d foot{kHall.x * (column + 0.5) / kPillarColumns, 0.0, kHall.z * (row + 0.5) / kPillarRows};
      // Every third one is twisted by up to a third of a turn.
      add_pillar(mesh, foot, column % 3 == 1 ? random.uniform(0.1, 0.33) : 0.0, sides);
    }
  }
  for (std::size_t i = 0; i < rods; ++i) {
    const Vec3d from = Vec3d{random.uniform(), random.uniform(0.4, 0.99), random.uniform()} * kHall;
    const Vec3d step{random.uniform(-6.0, 6.0), random.uniform(-2.0, 2.0), random.uniform(-6.0, 6.0)};
    add_rod(mesh, from, from + step, 0.01);
  }
  return mesh;
}

}  // namespace gridcast::measure
