// Rays along axes and in planes, zeros of either sign, and the ends of the range.

#include <array>
#include <set>

#include <gtest/gtest.h>

#include "core/blas/kd_tree.h"
#include "tests/stability/exact_subject.h"
#include "tests/stability/subject.h"
#include "tests/stability/truth.h"

namespace gridcast::stability {
namespace {

/// All 26 directions of -1, 0 and 1.
std::vector<Vec3d> lattice_directions() {
  std::vector<Vec3d> all;
  for (int i = 0; i < 27; ++i)
    if (i != 13) all.push_back(Vec3d(i % 3, i / 3 % 3, i / 9) - 1.0);
  return all;
}

/// The direction with every choice of +0 and -0 for its zeros, the first with +0 alone.
std::vector<Vec3d> signed_zeros(const Vec3d& direction) {
  std::vector<Vec3d> all = {glm::abs(direction) * glm::sign(direction) + 0.0};
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] != 0.0) continue;
    for (std::size_t i = all.size(); i-- > 0;) {
      all.push_back(all[i]);
      all.back()[axis] = -0.0;
    }
  }
  return all;
}

struct BoxCase {
  MeshSource mesh;
  Bounds3d box;
};
std::vector<BoxCase> boxes() {
  return {{generated("box -1 -1 -1 1 1 1"), {Vec3d(-1.0), Vec3d(1.0)}},
          {generated("box -1 -1 0 1 1 0"), {Vec3d(-1, -1, 0), Vec3d(1, 1, 0)}},
          {generated("quad_grid 8 8"), {Vec3d(0.0), Vec3d(8, 8, 0)}},
          {generated("quad_grid 64 64 | swap"), {Vec3d(0.0), Vec3d(64, 0, 64)}}};
}

/// Some of the lattice of points in and around a box, its planes, edges and corners among them.
std::vector<Vec3d> origins_around(const Bounds3d& box, test::Random& random, std::size_t count) {
  std::vector<Vec3d> all;
  for (std::size_t i = 0; i < count; ++i) {
    Vec3d origin;
    for (int axis = 0; axis < 3; ++axis) {
      const double places[] = {box.lower[axis] - 1.0, box.lower[axis], box.lower[axis] + 0.25,
                               box.center()[axis],    box.upper[axis], box.upper[axis] + 2.0};
      origin[axis] = places[random.below(6)];
    }
    all.push_back(origin);
  }
  return all;
}

TEST(Stability, RC01_ZeroDirectionComponent) {
  Row row(1, 12000);
  for (const BoxCase& box_case : boxes()) {
    const Bounds3d& box = box_case.box;
    const Subject subject(placed(box_case.mesh));
    // 24 + 24 + 8 rays an origin.
    row.blocks(row.rays(4) / 56 + 1, [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      std::vector<std::size_t> firsts;
      for (const Vec3d& origin : origins_around(box, random, count)) {
        for (const Vec3d& lattice : lattice_directions()) {
          const std::size_t first = shots.size();
          for (const Vec3d& direction : signed_zeros(lattice)) {
            const Ray ray{origin, direction, random.below(4) == 0 ? -4.0 : 0.0};
            shots.push_back({ray, {}, box_truth(box, ray)});
            shots.back().ray.tnear = shots[first].ray.tnear;
            shots.back().expected = box_truth(box, shots.back().ray);
            firsts.push_back(first);
          }
        }
      }
      Answers answers = subject.ask(row, shots);
      for (const Precision precision : kPrecisions) {
        const std::vector<SurfaceHit>& hits = answers.of(precision);
        for (std::size_t i = 0; i < hits.size(); ++i)
          if (!same_bits(hits[i], hits[firsts[i]]))
            row.fail(subject.spec(), shots[i], "-0 answers otherwise than +0: " + describe(hits[i]));
      }
    });
  }
}

TEST(Stability, RC02_RayInAFacePlane) {
  Row row(2, 8000);
  for (const BoxCase& box_case : boxes()) {
    const Bounds3d& box = box_case.box;
    Subject subject(placed(box_case.mesh));
    row.blocks(row.rays(4), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < count; ++i) {
        Ray ray;
        const auto along = int(random.below(3));
        ray.direction = Vec3d(random.below(2) == 0 ? 0.0 : -0.0);
        ray.direction[along] = random.below(2) == 0 ? 1.0 : -1.0;
        for (int axis = 0; axis < 3; ++axis) {
          // In one of the planes exactly, on the lattice, or anywhere.
          const std::uint32_t kind = random.below(4);
          const double inside = random.uniform(box.lower[axis], box.upper[axis]);
          ray.origin[axis] = kind == 0   ? box.lower[axis]
                             : kind == 1 ? box.upper[axis]
                             : kind == 2 ? std::round(inside)
                                         : inside;
        }
        ray.origin[along] = box.center()[along] - 2.0 * max_abs(box.extent()) * ray.direction[along];
        shots.push_back({ray, {}, box_truth(box, ray)});
      }
      subject.shoot(row, shots);
    });
  }
}

/// The planes of the kd-tree of a mesh, by axis.
std::array<std::vector<double>, 3> kd_planes(const mesh::TriangleMesh& mesh) {
  std::array<std::set<double>, 3> found;
  const auto tree = blas::KdTree::build(mesh, {}).value();
  for (const blas::KdTreelet& treelet : tree->layout().treelets)
    for (std::uint32_t k = 0; k < blas::KdTreelet::kPlanes; ++k)
      if (std::isfinite(treelet.planes[k])) found[std::size_t(treelet.axis(k))].insert(treelet.planes[k]);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    found[axis].insert(double(mesh.bounds().lower[int(axis)]));
    found[axis].insert(double(mesh.bounds().upper[int(axis)]));
  }
  std::array<std::vector<double>, 3> planes;
  for (std::size_t axis = 0; axis < 3; ++axis) planes[axis].assign(found[axis].begin(), found[axis].end());
  return planes;
}

// The same lattice of directions as RC01, starting on planes of the tree and running in them. The mesh is
// where its file has it, so that robust mode too must have the reference's hits, but for those at tnear
// within rounding.
TEST(Stability, RC33_KdPlaneWithoutDirection) {
  Row row(33, 16000);
  const char* const specs[] = {"jittered_icosphere 3 33", "box_city 6 3", "coplanar_stack 6 4",
                               "torus 24 16"};
  for (const char* spec : specs) {
    ExactSubject subject(placed(generated(spec)));
    const mesh::TriangleMesh& mesh = *subject.subject().spec().meshes[0].mesh;
    const auto planes = kd_planes(mesh);
    const Bounds3d box = to_double(mesh.bounds());
    row.blocks(row.rays(std::size(specs)), [&](test::Random& random, std::size_t count) {
      std::vector<Shot> shots;
      for (std::size_t i = 0; i < count; ++i) {
        Ray ray;
        for (int axis = 0; axis < 3; ++axis) {
          const auto& of_axis = planes[std::size_t(axis)];
          const bool on_plane = random.below(3) != 0;
          ray.origin[axis] = on_plane ? of_axis[random.below(std::uint32_t(of_axis.size()))]
                                      : random.uniform(box.lower[axis], box.upper[axis]);
          const std::uint32_t kind = random.below(5);
          ray.direction[axis] = kind == 0   ? 0.0
                                : kind == 1 ? -0.0
                                : kind == 2 ? 1.0
                                : kind == 3 ? -1.0
                                            : random.uniform(-1.0, 1.0);
        }
        if (max_abs(ray.direction) == 0.0) ray.direction[int(random.below(3))] = 1.0;
        if (random.below(2) == 0) ray.origin -= 2.0 * max_abs(box.extent()) * glm::sign(ray.direction);
        shots.push_back({ray, {}, {}});
      }
      subject.shoot(row, std::move(shots));
    });
    subject.seen().tell(spec);
    // Where an origin lies on a triangle, rounding decides whether t is below 0.
    EXPECT_LT(double(subject.seen().undecided), 0.01 * double(subject.seen().rays));
    EXPECT_LT(double(subject.seen().reordered), 0.006 * double(subject.seen().rays));
  }
}

// Hits at whole t exactly; the range is closed at both ends and empty when tnear > tfar.
TEST(Stability, RC20_EndsOfTheRange) {
  Row row(20, 6000);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  constexpr int kLayers = 4;
  Subject subject(placed(generated("coplanar_stack 4 4")));
  std::vector<double> ends = {0.0, -0.0, kInfinity, -kInfinity, 0x1p-1074, -0x1p-1074};
  for (int k = -3; k <= 9; ++k)
    for (const double t : {double(k), std::nextafter(k, kInfinity), std::nextafter(k, -kInfinity), k + 0.5})
      ends.push_back(t);
  row.blocks(row.rays(), [&](test::Random& random, std::size_t count) {
    std::vector<Shot> shots;
    for (std::size_t i = 0; i < count; ++i) {
      // Straight through the layers z = 0 ... 3 from a whole height, within a cell, at an edge or at a
      // vertex.
      const double height = double(random.below(9)) - 2.0;
      const double step = random.below(2) == 0 ? 1.0 : -1.0;
      const double x = 0.5 * double(random.below(9)),
                   y = random.below(2) == 0 ? 0.25 : double(random.below(5));
      const auto size = std::uint32_t(ends.size());
      Shot shot{
          {{x, y, height}, {0.0, 0.0, step}, ends[random.below(size)], ends[random.below(size)]}, {}, {}};
      double first = kInfinity;
      for (int layer = 0; layer < kLayers; ++layer) {
        const double t = (layer - height) * step;
        if (t >= shot.ray.tnear && t <= shot.ray.tfar) first = std::min(first, t);
      }
      shot.expected = first < kInfinity ? Expectation::hit({}, first) : Expectation::miss();
      shots.push_back(shot);
    }
    subject.shoot(row, shots);
  });
}

}  // namespace
}  // namespace gridcast::stability
