#include "tests/stability/mesh_spec.h"

#include <functional>
#include <map>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "core/measure/meshes.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace gridcast::stability {
namespace {

using mesh::TriangleMesh;

/// The numbers of one part of a spec.
class Numbers {
 public:
  Numbers(std::string part, std::vector<double> values)
      : part_(std::move(part)), values_(std::move(values)) {}
  [[nodiscard]] double operator[](std::size_t i) const {
    if (i >= values_.size()) throw std::invalid_argument("too few numbers in '" + part_ + "'");
    return values_[i];
  }
  [[nodiscard]] int integer(std::size_t i) const { return int((*this)[i]); }
  [[nodiscard]] std::size_t count(std::size_t i) const { return std::size_t((*this)[i]); }
  [[nodiscard]] std::uint64_t seed(std::size_t i) const { return std::uint64_t((*this)[i]); }
  [[nodiscard]] float real(std::size_t i) const { return float((*this)[i]); }
  [[nodiscard]] Vec3f vec(std::size_t i) const { return {real(i), real(i + 1), real(i + 2)}; }

 private:
  std::string part_;
  std::vector<double> values_;
};

void add_triangle(TriangleMesh& mesh, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  const auto first = std::uint32_t(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

/// All on one center, so that no split by centers parts them.
TriangleMesh concentric(int triangles) {
  TriangleMesh mesh;
  for (int i = 0; i < triangles; ++i) {
    const float size = 1.F + float(i % 1000) * 0x1p-6F;
    // The box of each is [-size, size]^2 x [0, 0] exactly.
    add_triangle(mesh, {-size, -size, 0.F}, {size, -size, 0.F}, {i % 2 == 0 ? size : 0.F, size, 0.F});
  }
  return mesh;
}

/// Each half as large and half as far as the one before: a median by place parts off one at a time.
TriangleMesh geometric(int triangles) {
  constexpr int kScales = 100;  // 2^-100 is far from the denormals
  TriangleMesh mesh;
  for (int i = 0; i < triangles; ++i) {
    const float s = std::ldexp(1.F, -(i % kScales));
    const float y = float(i / kScales) * 0x1p-4F * s;
    add_triangle(mesh, {s, y, 0.F}, {1.5F * s, y, 0.F}, {s, y, 0.5F * s});
  }
  return mesh;
}

/// `layers` lattices of `cells`^2 quads at z = 0, 1, ...: every triangle lies in a plane that a tree may
/// split at.
TriangleMesh coplanar_stack(int layers, int cells) {
  TriangleMesh all;
  for (int layer = 0; layer < layers; ++layer) {
    const TriangleMesh one = test::translated(test::quad_grid(cells, float(cells)), {0.F, 0.F, float(layer)});
    const auto first = std::uint32_t(all.positions.size());
    all.positions.insert(all.positions.end(), one.positions.begin(), one.positions.end());
    for (const auto& [a, b, c] : one.triangles) all.triangles.push_back({a + first, b + first, c + first});
  }
  return all;
}

/// Each triangle keeps its first corner and gets a size between 1 and 2^-40.
void shrink(TriangleMesh& mesh, std::uint64_t seed) {
  test::Random random(seed);
  TriangleMesh apart;
  for (std::uint32_t id = 0; id < mesh.triangle_count(); ++id) {
    const auto [a, b, c] = mesh.corners(id);
    const float size = std::ldexp(1.F, -int(random.below(41)));
    add_triangle(apart, a, a + size * (b - a), a + size * (c - a));
  }
  mesh = std::move(apart);
}

void shuffle(TriangleMesh& mesh, std::uint64_t seed) {
  test::Random random(seed);
  for (std::size_t i = mesh.triangles.size(); i > 1; --i)
    std::swap(mesh.triangles[i - 1], mesh.triangles[random.below(std::uint32_t(i))]);
}

using Generator = std::function<TriangleMesh(const Numbers&)>;
const std::map<std::string, Generator>& generators() {
  static const std::map<std::string, Generator> all = {
      {"triangle", [](const Numbers&) { return test::single_triangle(); }},
      {"box", [](const Numbers& n) { return test::box(n.vec(0), n.vec(3)); }},
      {"icosphere", [](const Numbers& n) { return test::icosphere(n.integer(0)); }},
      {"jittered_icosphere",
       [](const Numbers& n) { return test::jittered_icosphere(n.integer(0), n.seed(1)); }},
      {"torus", [](const Numbers& n) { return test::torus(n.integer(0), n.integer(1)); }},
      {"needle_fan", [](const Numbers& n) { return test::needle_fan(n.integer(0)); }},
      {"quad_grid", [](const Numbers& n) { return test::quad_grid(n.integer(0), n.real(1)); }},
      {"soup", [](const Numbers& n) { return test::soup(n.integer(0), n.seed(1), n.real(2)); }},
      {"slivers", [](const Numbers& n) { return test::slivers(n.integer(0), n.seed(1), n.real(2)); }},
      {"voxels", [](const Numbers& n) { return test::voxel_boundary(n.integer(0), n.seed(1)); }},
      {"organic", [](const Numbers& n) { return measure::organic_mesh(n.count(0), n.seed(1)); }},
      {"flat", [](const Numbers& n) { return measure::flat_mesh(n.count(0), n.seed(1)); }},
      {"box_city", [](const Numbers& n) { return test::box_city(n.integer(0), n.seed(1)); }},
      {"concentric", [](const Numbers& n) { return concentric(n.integer(0)); }},
      {"geometric", [](const Numbers& n) { return geometric(n.integer(0)); }},
      {"coplanar_stack", [](const Numbers& n) { return coplanar_stack(n.integer(0), n.integer(1)); }},
  };
  return all;
}

using Change = std::function<void(TriangleMesh&, const Numbers&)>;
const std::map<std::string, Change>& changes() {
  static const std::map<std::string, Change> all = {
      {"scale",
       [](TriangleMesh& mesh, const Numbers& n) {
         for (Vec3f& p : mesh.positions) p *= n.vec(0);
       }},
      {"translate", [](TriangleMesh& mesh, const Numbers& n) { mesh = test::translated(mesh, n.vec(0)); }},
      {"swap",
       [](TriangleMesh& mesh, const Numbers&) {
         for (Vec3f& p : mesh.positions) p = {p.y, p.z, p.x};
       }},
      {"repeat", [](TriangleMesh& mesh, const Numbers& n) { mesh = test::repeated(mesh, n.integer(0)); }},
      {"shuffle", [](TriangleMesh& mesh, const Numbers& n) { shuffle(mesh, n.seed(0)); }},
      {"shrink", [](TriangleMesh& mesh, const Numbers& n) { shrink(mesh, n.seed(0)); }},
  };
  return all;
}

}  // namespace

mesh::TriangleMesh make_mesh(const std::string& spec) {
  TriangleMesh mesh;
  std::istringstream parts(spec);
  std::string part;
  for (bool first = true; std::getline(parts, part, '|'); first = false) {
    std::istringstream words(part);
    std::string name, word;
    words >> name;
    std::vector<double> values;
    while (words >> word) values.push_back(std::stod(word));
    const Numbers numbers(part, std::move(values));
    const auto generator = generators().find(name);
    const auto change = changes().find(name);
    if (first && generator != generators().end()) {
      mesh = generator->second(numbers);
    } else if (!first && change != changes().end()) {
      change->second(mesh, numbers);
    } else {
      throw std::invalid_argument("unknown mesh '" + part + "'");
    }
  }
  return mesh;
}

}  // namespace gridcast::stability
