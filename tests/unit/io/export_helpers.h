#pragma once
// Scenes written as GLB and read back.

#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/io/gltf_export.h"
#include "tests/unit/io/import_helpers.h"
#include "tests/unit/scene/scene_fixture.h"

namespace gridcast::test {

inline std::string exported(const scene::Scene& scene) {
  auto glb = io::export_glb(scene);
  if (glb) return std::move(glb).value();
  ADD_FAILURE() << "refused: " << glb.error().message << " at " << glb.error().where;
  return {};
}

inline std::vector<std::byte> as_vector(const std::string& text) {
  const auto bytes = std::as_bytes(std::span(text));
  return {bytes.begin(), bytes.end()};
}

inline std::shared_ptr<const scene::Scene> read_back(const std::string& glb) {
  return scene::built(import_ok(as_vector(glb)));
}

/// A GLB taken to pieces, all lengths and paddings checked.
struct Glb {
  nlohmann::json document;
  std::string bin;
};
inline Glb take_apart(const std::string& glb) {
  const auto word = [&](std::size_t at) {
    std::uint32_t value = 0;
    if (at + 4 <= glb.size()) std::memcpy(&value, glb.data() + at, 4);
    return std::size_t(value);
  };
  Glb parts;
  EXPECT_EQ(glb.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2U);
  EXPECT_EQ(word(8), glb.size());
  EXPECT_EQ(word(12) % 4, 0U);
  EXPECT_EQ(glb.substr(16, 4), "JSON");
  parts.document = nlohmann::json::parse(glb.substr(20, word(12)));
  const std::size_t bin_at = 20 + word(12);
  if (bin_at == glb.size()) return parts;
  EXPECT_EQ(word(bin_at) % 4, 0U);
  EXPECT_EQ(word(bin_at) + bin_at + 8, glb.size());
  EXPECT_EQ(glb.substr(bin_at + 4, 4), std::string("BIN\0", 4));
  parts.bin = glb.substr(bin_at + 8);
  return parts;
}

/// The ids that the living instances of `scene` have after an export, at the place of their own.
inline std::vector<std::uint32_t> ids_after_export(const scene::Scene& scene) {
  std::vector<std::uint32_t> ids(scene.instance_slots(), kInvalidId);
  std::uint32_t next = 0;
  for (std::uint32_t id = 0; id < ids.size(); ++id)
    if (scene.find_instance(id)) ids[id] = next++;
  return ids;
}

/// `count` rays into both scenes have the same closest hits, bit for bit. Returns how many hit.
inline int expect_same_answers(const scene::Scene& before, const scene::Scene& after, int count,
                               std::uint64_t seed) {
  const std::vector<std::uint32_t> ids = ids_after_export(before);
  Random random(seed);
  int hits = 0;
  for (int i = 0; i < count; ++i) {
    const Ray ray = scene::random_ray(before, random);
    const Precision precision = i % 8 == 0 ? Precision::kExact : Precision::kRobust;
    SurfaceHit expected = intersect(before, ray, precision);
    const SurfaceHit found = intersect(after, ray, precision);
    if (expected.instance_id != kInvalidId) expected.instance_id = ids[expected.instance_id];
    EXPECT_TRUE(scene::same(expected, found)) << "ray " << i << " of seed " << seed;
    if (!scene::same(expected, found)) return hits;
    hits += int(found.status == RayStatus::kHit);
  }
  return hits;
}

}  // namespace gridcast::test
