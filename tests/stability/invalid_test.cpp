// What is no ray and no mesh is told so, by its place, and harms nothing around it.

#include <cmath>
#include <cstring>

#include <gtest/gtest.h>

#include "core/io/gltf.h"
#include "core/mesh/topology.h"
#include "tests/stability/subject.h"
#include "tests/stability/truth.h"
#include "tests/support/gltf_builder.h"

namespace gridcast::stability {
namespace {

/// The eight numbers of a ray.
Ray ray_of(const std::array<double, 8>& n) {
  return {{n[0], n[1], n[2]}, {n[3], n[4], n[5]}, n[6], n[7]};
}

// Every subset of the eight fields replaced by each of the values; the answer is invalid exactly where the
// contract says so, and a NaN or an infinity never becomes a hit. Good rays between them keep their answers.
TEST(Stability, RC18_InvalidRays) {
  Row row(18, 4000);
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Subject subject(placed(generated("jittered_icosphere 2 18")));
  const WorldTruth truth(subject.spec());
  const std::array<double, 8> good = {3.0, 0.1, 0.2, -1.0, 0.0, -0.0, 0.0, 1e9};
  const Shot plain = truth.shot(subject.scene(), ray_of(good));
  ASSERT_EQ(plain.expected.kind, Expectation::Kind::kHit);
  std::vector<Shot> shots;
  std::size_t invalid = 0;
  for (const double value :
       {std::nan(""), -std::nan(""), kInfinity, -kInfinity, 1e19, 3.4e38, 1e308, 0x1p-1074}) {
    for (unsigned fields = 1; fields < 256; ++fields) {
      std::array<double, 8> numbers = good;
      for (std::size_t i = 0; i < 8; ++i)
        if ((fields >> i & 1U) != 0) numbers[i] = value;
      const Ray ray = ray_of(numbers);
      // The contract, in words of its own: core/math/ray.h.
      bool valid = true;
      double longest = 0.0;
      for (std::size_t i = 0; i < 8; ++i) valid = valid && !std::isnan(numbers[i]);
      for (std::size_t i = 0; i < 3; ++i) valid = valid && std::abs(numbers[i]) <= 0x1p100;
      for (std::size_t i = 3; i < 6; ++i) longest = std::max(longest, std::abs(numbers[i]));
      valid = valid && longest <= 0x1p200 && longest >= 0x1p-200;
      invalid += std::size_t(!valid);
      shots.push_back(valid ? truth.shot(subject.scene(), ray) : Shot{ray, {}, Expectation::invalid()});
      shots.push_back(plain);
    }
  }
  (void)subject.ask(row, shots);
  EXPECT_GT(invalid, 1000U);
  // No direction at all, of either sign.
  std::vector<Shot> none;
  for (const Vec3d& zero : {Vec3d(0.0), Vec3d(-0.0), Vec3d(0.0, -0.0, 0.0)})
    none.push_back({{{3.0, 0.0, 0.0}, zero}, {}, Expectation::invalid()});
  (void)subject.ask(row, none);
}

/// Refused as a file, with the place that is wrong and, in the message, the element.
void expect_refused(Row& row, const test::GltfBuilder& builder, const std::string& where,
                    const std::string& element) {
  const auto data = io::import_gltf(builder.glb());
  row.count(1, 1);
  if (data.ok()) return row.fail("a file is accepted that is wrong at " + where);
  if (data.error().code != ErrorCode::kInvalidFile)
    row.fail("refused by another code: " + data.error().message);
  if (data.error().where != where) row.fail("refused at " + data.error().where + ", not at " + where);
  if (data.error().message.find(element) == std::string::npos)
    row.fail("refused without naming " + element + ": " + data.error().message);
}

TEST(Stability, RC19_InvalidMeshes) {
  Row row(19, 100);
  // In files: by accessor and element.
  for (const float bad : {std::nanf(""), -std::nanf(""), INFINITY, -INFINITY, 1.1e18F, 3.4e38F}) {
    for (std::size_t place = 0; place < 9; ++place) {
      std::vector<float> numbers = {0, 0, 0, 1, 0, 0, 0, 1, 0};
      numbers[place] = bad;
      test::GltfBuilder builder;
      const int accessor = builder.add_accessor<float>("VEC3", numbers);
      builder.add_node({{"mesh", builder.add_mesh({{"attributes", {{"POSITION", accessor}}}})}});
      expect_refused(row, builder, "/accessors/0", "element " + std::to_string(place / 3));
    }
  }
  for (const std::uint32_t bad : {3U, 4U, 65535U, 0x7FFFFFFFU, 0xFFFFFFFFU}) {
    for (std::size_t place = 0; place < 3; ++place) {
      std::vector<std::uint32_t> numbers = {0, 1, 2};
      numbers[place] = bad;
      test::GltfBuilder builder = test::triangle_document();
      const int accessor = builder.add_accessor<std::uint32_t>("SCALAR", numbers);
      builder.document["meshes"][0]["primitives"][0]["indices"] = accessor;
      expect_refused(row, builder, "/meshes/0/primitives/0/indices", "vertex " + std::to_string(bad));
    }
  }
  // And as data, whoever made it.
  const MeshSource source = generated("jittered_icosphere 1 19");
  const auto refusal = [&](const auto& spoil) {
    mesh::TriangleMesh mesh = *source.mesh;
    spoil(mesh);
    const auto built = scene::build_scene(scene_data(placed(given(std::move(mesh)))));
    row.count(1, 1);
    return built.ok() ? std::string("accepted") : built.error().where;
  };
  for (const float bad : {std::nanf(""), INFINITY, -INFINITY, 1.1e18F})
    EXPECT_EQ(refusal([&](mesh::TriangleMesh& mesh) { mesh.positions[7].z = bad; }), "/meshes/0/positions/7");
  for (const std::uint32_t bad : {std::uint32_t(source.mesh->positions.size()), 0xFFFFFFFFU})
    EXPECT_EQ(refusal([&](mesh::TriangleMesh& mesh) { mesh.triangles[5][1] = bad; }),
              "/meshes/0/triangles/5");
}

/// A file with a mesh whose edges have three faces, whose vertices join two surfaces, with a face there twice
/// and turned: what half-edges cannot hold.
test::GltfBuilder complex_document(std::vector<mesh::Triangle>& triangles) {
  triangles = {{0, 1, 2}, {0, 1, 3}, {0, 1, 4}, {1, 0, 2}, {0, 1, 2},
               {5, 6, 2}, {2, 5, 7}, {7, 7, 2}, {3, 4, 5}};
  const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, -1, 0,
                                        0, 0, 1, 2, 2, 0, 3, 2, 0, 2, 3,  1};
  std::vector<std::uint16_t> indices;
  for (const mesh::Triangle& t : triangles)
    for (const std::uint32_t index : t) indices.push_back(std::uint16_t(index));
  test::GltfBuilder builder;
  const int position = builder.add_accessor<float>("VEC3", positions);
  const int index = builder.add_accessor<std::uint16_t>("SCALAR", indices);
  builder.add_node(
      {{"mesh", builder.add_mesh({{"attributes", {{"POSITION", position}}}, {"indices", index}})}});
  return builder;
}

// Half-edges drop faces that they cannot attach. They serve topology alone: every triangle of the file is
// cast at under the file's number.
TEST(Stability, RC44_EveryTriangleIsCastAt) {
  Row row(44, 200);
  std::vector<mesh::Triangle> triangles;
  const auto data = io::import_gltf(complex_document(triangles).glb());
  ASSERT_TRUE(data.ok()) << data.error().message;
  ASSERT_EQ(data->meshes.at(0)->triangles, triangles);
  const mesh::TriangleMesh& mesh = *data->meshes[0];
  const auto complex = mesh::analyse_topology(mesh);
  EXPECT_GT(complex.non_manifold_edges, 0U);
  const Subject subject(placed(given(mesh)));
  EXPECT_EQ(subject.scene().stored_triangle_count(), triangles.size());
  std::vector<Shot> shots;
  for (std::uint32_t id = 0; id < triangles.size(); ++id) {
    const auto [a, b, c] = mesh.corners(id);
    const Vec3d normal = glm::cross(Vec3d(b - a), Vec3d(c - a));
    if (normal == Vec3d(0.0)) continue;
    // Of equal faces the first one answers, unless it is left out.
    const Vec3d middle = 0.25 * Vec3d(a) + 0.375 * Vec3d(b) + 0.375 * Vec3d(c);
    const Ray ray{middle + 0.0625 * normal, -normal, 0.0624, 0.0626};
    std::vector<std::uint32_t> equal;
    for (std::uint32_t other = 0; other < triangles.size(); ++other) {
      auto x = triangles[id], y = triangles[other];
      std::sort(x.begin(), x.end());
      std::sort(y.begin(), y.end());
      if (x == y) equal.push_back(other);
    }
    shots.push_back({ray, {}, Expectation::hit({0, equal.front()})});
    if (equal.size() > 1) shots.push_back({ray, {0, equal[0]}, Expectation::hit({0, equal[1]})});
  }
  (void)subject.ask(row, shots);
}

}  // namespace
}  // namespace gridcast::stability
