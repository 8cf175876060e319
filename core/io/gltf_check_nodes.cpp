#include <string>
#include <vector>

#include "core/io/gltf_check.h"

namespace gridcast::io {
namespace {

std::size_t count_of(const Cursor& root, const char* name) {
  const auto array = root.find(name);
  return array ? array->size() : 0;
}

std::size_t light_count(const Cursor& root) {
  const auto extensions = root.find("extensions");
  if (!extensions) return 0;
  const auto lights = extensions->find("KHR_lights_punctual");
  return lights ? count_of(*lights, "lights") : 0;
}

void check_indices(const Cursor& array, std::size_t size) {
  const std::size_t n = array.size();
  for (std::size_t i = 0; i < n; ++i) (void)array.element(i).index(size);
}

void check_transform(const Cursor& node) {
  node.expect_numbers_in("matrix", 16);
  node.expect_numbers_in("translation", 3);
  node.expect_numbers_in("rotation", 4);
  node.expect_numbers_in("scale", 3);
  if (node.has("matrix") && (node.has("translation") || node.has("rotation") || node.has("scale")))
    node.refuse_here("a node has either a matrix or translation, rotation and scale");
}

void check_gpu_instancing(const Cursor& extension, std::size_t accessors) {
  const auto attributes = extension.find("attributes");
  if (!attributes) return;
  attributes->expect_object();
  for (const auto& item : attributes->json().items())
    (void)attributes->require(item.key().c_str()).index(accessors);
}

struct NodeCounts {
  std::size_t accessors, cameras, lights, meshes, nodes, skins;
};

void check_node(const Cursor& node, const NodeCounts& counts) {
  if (const auto children = node.find("children")) check_indices(*children, counts.nodes);
  (void)node.index_in("mesh", counts.meshes);
  (void)node.index_in("skin", counts.skins);
  (void)node.index_in("camera", counts.cameras);
  check_transform(node);
  if (const auto weights = node.find("weights")) weights->expect_numbers();
  const auto extensions = node.find("extensions");
  if (!extensions) return;
  if (const auto light = extensions->find("KHR_lights_punctual"))
    (void)light->require("light").index(counts.lights);
  if (const auto gpu = extensions->find("EXT_mesh_gpu_instancing"))
    check_gpu_instancing(*gpu, counts.accessors);
}

void check_skins(const Cursor& root, std::size_t nodes) {
  const std::size_t accessor_count = count_of(root, "accessors");
  root.each_object("skins", [&](const Cursor& skin, std::size_t) {
    const Cursor joints = skin.require("joints");
    check_indices(joints, nodes);
    if (joints.size() == 0) joints.refuse_here("a skin needs at least one joint");
    (void)skin.index_in("skeleton", nodes);
    const auto matrices = skin.index_in("inverseBindMatrices", accessor_count);
    if (!matrices) return;
    const Json& accessor = root.json()["accessors"][*matrices];
    if (accessor["type"] != "MAT4" || accessor["componentType"] != kFloat)
      skin.require("inverseBindMatrices").refuse_here("must be a float MAT4 accessor");
    if (accessor["count"].get<std::int64_t>() < std::int64_t(joints.size()))
      skin.require("inverseBindMatrices").refuse_here("has fewer matrices than the skin has joints");
  });
}

void check_scenes(const Cursor& root, std::size_t nodes) {
  root.each_object("scenes", [&](const Cursor& scene, std::size_t) {
    if (const auto roots = scene.find("nodes")) check_indices(*roots, nodes);
  });
  (void)root.index_in("scene", count_of(root, "scenes"));
}

}  // namespace

void check_nodes(const Cursor& root) {
  const NodeCounts counts{count_of(root, "accessors"), count_of(root, "cameras"), light_count(root),
                          count_of(root, "meshes"),    count_of(root, "nodes"),   count_of(root, "skins")};
  root.each_object("nodes", [&](const Cursor& node, std::size_t) { check_node(node, counts); });
  check_skins(root, counts.nodes);
  check_scenes(root, counts.nodes);
}

void check_forest(const Cursor& root) {
  const std::size_t n = count_of(root, "nodes");
  constexpr std::uint32_t kNone = 0xFFFFFFFFU;
  std::vector<std::uint32_t> parent(n, kNone);
  root.each_object("nodes", [&](const Cursor& node, std::size_t i) {
    const auto children = node.find("children");
    if (!children) return;
    for (std::size_t c = 0; c < children->size(); ++c) {
      const Cursor child = children->element(c);
      std::uint32_t& above = parent[child.json().get<std::uint32_t>()];
      if (above != kNone) child.refuse_here("the node already has a parent, node " + std::to_string(above));
      above = std::uint32_t(i);
    }
  });
  // With one parent each, a node that does not lead up to a root lies on or below a cycle. Every node is
  // walked over once: the walk stops at nodes known to lead to a root.
  enum class Mark : std::uint8_t { kNew, kOnWay, kDone };
  std::vector<Mark> mark(n, Mark::kNew);
  for (std::size_t i = 0; i < n; ++i) {
    std::uint32_t at = std::uint32_t(i);
    for (; at != kNone && mark[at] == Mark::kNew; at = parent[at]) mark[at] = Mark::kOnWay;
    if (at != kNone && mark[at] == Mark::kOnWay)
      root.find("nodes")->element(at).refuse_here("the node is its own descendant");
    for (at = std::uint32_t(i); at != kNone && mark[at] == Mark::kOnWay; at = parent[at])
      mark[at] = Mark::kDone;
  }
}

}  // namespace gridcast::io
