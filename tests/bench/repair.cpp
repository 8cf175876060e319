// What a repair of a refitted tree costs and is worth, against building the whole tree anew, over local and
// global deformations of one mesh. On one thread, thread CPU time, contenders one after the other.
//   build/release/bin/bench_repair [TRIANGLES] [REPETITIONS]

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include <oneapi/tbb/task_arena.h>

#include "core/blas/blas.h"
#include "core/measure/meshes.h"
#include "core/measure/random.h"
#include "core/measure/statistics.h"
#include "core/mesh/object_ray.h"

namespace gridcast {
namespace {

using blas::Blas;
using measure::Random;
using measure::Samples;
using Mesh = std::shared_ptr<const mesh::TriangleMesh>;

constexpr std::uint64_t kSeed = 11;
constexpr std::size_t kRays = 10000;

struct Ball {
  Vec3d center{0.0};
  double radius = 0.0;
};

/// The `share` of the vertices that is nearest to vertex 0, and the ball around them.
std::vector<std::uint32_t> patch(const mesh::TriangleMesh& mesh, double share, Ball& ball) {
  std::vector<std::uint32_t> vertices(mesh.positions.size());
  std::iota(vertices.begin(), vertices.end(), 0U);
  ball.center = Vec3d(mesh.positions[0]);
  const auto distance = [&](std::uint32_t v) { return glm::length(Vec3d(mesh.positions[v]) - ball.center); };
  const auto count = std::max<std::size_t>(1, std::size_t(share * double(vertices.size())));
  std::nth_element(vertices.begin(), vertices.begin() + std::ptrdiff_t(count - 1), vertices.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return distance(a) < distance(b); });
  vertices.resize(count);
  ball.radius = distance(vertices.back());
  return vertices;
}

Vec3d turned(const Vec3d& p, double angle) {
  return {std::cos(angle) * p.x - std::sin(angle) * p.z, p.y, std::sin(angle) * p.x + std::cos(angle) * p.z};
}

using Move = std::function<void(mesh::TriangleMesh&, const std::vector<std::uint32_t>&, const Ball&)>;

/// Every vertex goes somewhere within a part of the patch's radius.
Move scatter(double reach) {
  return [reach](mesh::TriangleMesh& mesh, const std::vector<std::uint32_t>& vertices, const Ball& ball) {
    Random random(kSeed);
    for (const std::uint32_t v : vertices) mesh.positions[v] += Vec3f(random.in_box(reach * ball.radius));
  };
}

void shuffle(mesh::TriangleMesh& mesh, const std::vector<std::uint32_t>& vertices, const Ball& /*ball*/) {
  Random random(kSeed);
  for (std::size_t i = vertices.size(); i > 1; --i)
    std::swap(mesh.positions[vertices[i - 1]], mesh.positions[vertices[random.below(std::uint32_t(i))]]);
}

/// Around the axis through the middle of the patch, more towards it; still outside.
Move swirl(double turns) {
  return [turns](mesh::TriangleMesh& mesh, const std::vector<std::uint32_t>& vertices, const Ball& ball) {
    for (const std::uint32_t v : vertices) {
      const Vec3d p = Vec3d(mesh.positions[v]) - ball.center;
      const double inward = 1.0 - glm::length(p) / ball.radius;
      mesh.positions[v] = Vec3f(ball.center + turned(p, 2.0 * M_PI * turns * inward));
    }
  };
}

/// Along the mesh's y axis.
Move twist(double turns) {
  return [turns](mesh::TriangleMesh& mesh, const std::vector<std::uint32_t>& vertices, const Ball& /*ball*/) {
    const Bounds3d bounds = to_double(mesh.bounds());
    for (const std::uint32_t v : vertices) {
      const Vec3d p = Vec3d(mesh.positions[v]) - bounds.center();
      mesh.positions[v] = Vec3f(bounds.center() + turned(p, 2.0 * M_PI * turns * p.y / bounds.extent().y));
    }
  };
}

void fold(mesh::TriangleMesh& mesh, const std::vector<std::uint32_t>& vertices, const Ball& /*ball*/) {
  const float middle = mesh.bounds().center().x;
  for (const std::uint32_t v : vertices) mesh.positions[v].x = std::abs(mesh.positions[v].x - middle);
}

/// The same triangles, no two of which share a vertex.
Mesh in_pieces(const mesh::TriangleMesh& mesh) {
  auto pieces = std::make_shared<mesh::TriangleMesh>();
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    for (const Vec3f& corner : mesh.corners(id)) pieces->positions.push_back(corner);
    pieces->triangles.push_back({3 * id, 3 * id + 1, 3 * id + 2});
  }
  return pieces;
}

/// Triangles of a mesh in pieces fly apart within a part of the patch's radius, each as it is.
Move burst(double reach) {
  return [reach](mesh::TriangleMesh& mesh, const std::vector<std::uint32_t>& vertices, const Ball& ball) {
    for (const std::uint32_t v : vertices) {
      Random random(kSeed + v / 3);  // a triangle's vertices follow each other
      mesh.positions[v] += Vec3f(random.in_box(reach * ball.radius));
    }
  };
}

struct Case {
  std::string name;
  Mesh mesh;
  double share;
  Move move;
};

std::vector<mesh::ObjectRay> rays_at(const Blas& tree, const Ball& ball) {
  Random random(kSeed + 1);
  std::vector<mesh::ObjectRay> rays;
  while (rays.size() < kRays) {
    const Vec3d origin = ball.center + 3.0 * ball.radius * random.direction();
    const Vec3d target = ball.center + ball.radius * random.in_box(0.7);
    mesh::ObjectRay ray;
    if (!ray.prepare({origin, target - origin}, tree.bounds())) continue;
    ray.instance_id = 0;
    ray.excluded_primitive = kInvalidId;
    rays.push_back(ray);
  }
  return rays;
}

void trace(const Blas& tree, const std::vector<mesh::ObjectRay>& rays) {
  static double sum = 0.0;
  for (const mesh::ObjectRay& ray : rays) {
    Hit hit;
    if (tree.intersect<Precision::kRobust>(ray, hit)) sum += hit.t;
  }
  if (sum < 0.0) std::puts("");
}

/// Times of contenders that take turns, each after one run to warm up; the first is what they are compared
/// with.
std::vector<Samples> in_turns(int repetitions, const std::vector<std::function<void()>>& contenders) {
  std::vector<Samples> samples(contenders.size());
  for (int turn = -1; turn < repetitions; ++turn) {
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      const double taken = measure::seconds(measure::ClockKind::kThread, contenders[i]);
      if (turn >= 0) samples[i].push_back(taken);
    }
  }
  return samples;
}

std::string relative(const std::vector<Samples>& samples) {
  std::string text;
  for (std::size_t i = 1; i < samples.size(); ++i) {
    char cell[48];
    std::snprintf(cell, sizeof cell, "%s%.2f", i > 1 ? ", " : "", measure::speedup(samples[0], samples[i]));
    text += cell;
  }
  return text.insert(0, "| ").append(" ");
}

const char* name_of(blas::RepairOutcome outcome) {
  switch (outcome) {
    case blas::RepairOutcome::kUnneeded:
      return "unneeded";
    case blas::RepairOutcome::kRepaired:
      return "repaired";
    case blas::RepairOutcome::kRebuild:
      break;
  }
  return "rebuild";
}

void print_times(const std::vector<Samples>& samples) {
  for (const Samples& sample : samples)
    std::printf("| %.2f (%.0f %%) ", 1e3 * measure::median(sample), 100.0 * measure::spread(sample));
}

void measure_case(const Case& c, int repetitions) {
  const Mesh& mesh = c.mesh;
  using blas::BuildQuality;
  using blas::StructureKind;
  const blas::BuildOptions sah{.kind = StructureKind::kWideBvh, .spatial = blas::SpatialSplits::kNever};
  blas::BuildOptions morton = sah;
  morton.quality = BuildQuality::kFast;

  auto moved = std::make_shared<mesh::TriangleMesh>(*mesh);
  Ball ball;
  c.move(*moved, patch(*mesh, c.share, ball), ball);
  const Blas built = Blas::build(mesh, sah).value();
  const Blas bad = built.refit(moved).value();
  const auto repaired = bad.repair().value();
  const Blas fresh = Blas::build(moved, sah).value(), fast = Blas::build(moved, morton).value();
  std::printf("| %s %.3g %% | %s, %zu in %zu | %.2f, %.2f, %.2f ", c.name.c_str(), 100.0 * c.share,
              name_of(repaired.outcome), repaired.triangles, repaired.subtrees,
              bad.stats().cost / fresh.stats().cost, repaired.cost_after / fresh.stats().cost,
              fast.stats().cost / fresh.stats().cost);

  Blas spare = bad;
  print_times(in_turns(
      repetitions,
      {[&] { spare = built.refit(moved).value(); }, [&] { (void)bad.repair().value(); },
       [&] { (void)Blas::build(moved, morton).value(); }, [&] { (void)Blas::build(moved, sah).value(); }}));
  const Bounds3d bounds = to_double(moved->bounds());
  const Ball whole{bounds.center(), 0.5 * max_abs(bounds.extent())};
  for (const Ball& where : {ball, whole}) {
    const auto rays = rays_at(bad, where);
    std::vector<std::function<void()>> contenders;
    for (const Blas* tree : {&fresh, &bad, &repaired.blas, &fast})
      contenders.push_back([tree, &rays] { trace(*tree, rays); });
    std::printf("%s", relative(in_turns(repetitions, contenders)).c_str());
  }
  std::puts("|");
  std::fflush(stdout);
}

void run(std::size_t triangles, int repetitions) {
  const auto mesh = std::make_shared<const mesh::TriangleMesh>(measure::scan_mesh(triangles, kSeed));
  std::printf("%zu triangles, %d repetitions\n", mesh->triangle_count(), repetitions);
  std::puts(
      "| deformation of the nearest vertices | outcome, triangles in subtrees | cost by that of a new tree: "
      "refitted, repaired, Morton "
      "| refit ms | repair ms | Morton build ms | SAH build ms | rays at the patch by a new tree's: "
      "refitted, repaired, Morton | rays at all |");
  std::puts("|---|---|---|---|---|---|---|---|---|");
  const Mesh pieces = in_pieces(*mesh);
  std::vector<Case> cases;
  for (const double share : {0.01, 0.05, 0.2}) {
    cases.push_back({"pieces fly apart", pieces, share, burst(0.3)});
    cases.push_back({"vertices scatter", mesh, share, scatter(0.3)});
    cases.push_back({"vertices change places", mesh, share, shuffle});
    cases.push_back({"swirl of 4 turns", mesh, share, swirl(4.0)});
  }
  cases.push_back({"pieces fly apart", pieces, 1.0, burst(0.3)});
  cases.push_back({"twist of 1 turn", mesh, 1.0, twist(1.0)});
  cases.push_back({"twist of 4 turns", mesh, 1.0, twist(4.0)});
  cases.push_back({"fold", mesh, 1.0, fold});
  oneapi::tbb::task_arena(1).execute([&] {
    for (const Case& c : cases) measure_case(c, repetitions);
  });
}

}  // namespace
}  // namespace gridcast

int main(int argc, char** argv) {
  const std::size_t triangles = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 268000;
  gridcast::run(triangles, argc > 2 ? std::atoi(argv[2]) : 7);
  return 0;
}
