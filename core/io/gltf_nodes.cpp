#include <algorithm>
#include <string>

#include "core/io/gltf_import.h"
#include "core/io/gltf_instances.h"
#include "core/io/gltf_transform.h"

namespace gridcast::io {
namespace {

scene::Node make_node(const tinygltf::Node& source, std::uint32_t file_index, std::uint32_t parent) {
  scene::Node node;
  node.name = source.name;
  node.parent = parent;
  node.file_index = file_index;
  if (source.mesh >= 0) node.mesh_id = std::uint32_t(source.mesh);
  if (source.skin >= 0) node.skin_id = std::uint32_t(source.skin);
  node.weights.assign(source.weights.begin(), source.weights.end());
  if (source.matrix.size() == 16) {
    node.local = affine_from_matrix(source.matrix.data());
    node.trs = trs_from_affine(node.local);
    return node;
  }
  const auto& [t, r, s] = std::tie(source.translation, source.rotation, source.scale);
  if (t.size() == 3) node.trs.translation = {t[0], t[1], t[2]};
  if (r.size() == 4) node.trs.rotation = {r[0], r[1], r[2], r[3]};
  if (s.size() == 3) node.trs.scale = {s[0], s[1], s[2]};
  node.local = affine_from_trs(node.trs);
  return node;
}

std::vector<std::uint32_t> find_parents(const tinygltf::Model& model) {
  std::vector<std::uint32_t> parents(model.nodes.size(), kInvalidId);
  for (std::size_t i = 0; i < model.nodes.size(); ++i)
    for (const int child : model.nodes[i].children) parents[std::size_t(child)] = std::uint32_t(i);
  return parents;
}

/// Adds every node, a parent always before its children: depth first with an explicit stack, since a chain
/// may be as long as the file. Returns each file node's place.
std::vector<std::uint32_t> add_nodes(const tinygltf::Model& model, scene::SceneData& out) {
  const std::vector<std::uint32_t> parents = find_parents(model);
  std::vector<std::uint32_t> place(model.nodes.size(), kInvalidId);
  std::vector<std::uint32_t> pending;
  for (std::size_t root = 0; root < model.nodes.size(); ++root) {
    if (parents[root] != kInvalidId) continue;
    pending.push_back(std::uint32_t(root));
    while (!pending.empty()) {
      const std::uint32_t index = pending.back();
      pending.pop_back();
      place[index] = std::uint32_t(out.nodes.size());
      const std::uint32_t parent = parents[index] == kInvalidId ? kInvalidId : place[parents[index]];
      out.nodes.push_back(make_node(model.nodes[index], index, parent));
      const auto& children = model.nodes[index].children;
      std::for_each(children.rbegin(), children.rend(),
                    [&](int child) { pending.push_back(std::uint32_t(child)); });
    }
  }
  return place;
}

/// The world transform of each entry of out.nodes.
std::vector<Affine> make_worlds(const scene::SceneData& out) {
  std::vector<Affine> worlds(out.nodes.size());
  for (std::size_t i = 0; i < out.nodes.size(); ++i) {
    const scene::Node& node = out.nodes[i];
    worlds[i] = node.parent == kInvalidId ? node.local : worlds[node.parent] * node.local;
    if (!is_finite(worlds[i]))
      refuse_invalid("the node's world transform leaves the range of double",
                     pointer("nodes", node.file_index));
  }
  return worlds;
}

/// Whether each file node belongs to the chosen scene.
std::vector<bool> choose_nodes(ImportContext& context, const std::vector<std::uint32_t>& place,
                               scene::SceneData& out) {
  const tinygltf::Model& model = context.storage.model();
  std::vector<bool> chosen(out.nodes.size(), model.scenes.empty());
  if (context.options.scene_index && *context.options.scene_index >= model.scenes.size())
    refuse(ErrorCode::kNotFound, "there is no scene with this index",
           pointer("scenes", *context.options.scene_index));
  if (model.scenes.empty()) {
    if (!model.nodes.empty()) context.warnings.add("the document has no scene: every node is placed");
  } else {
    const std::size_t fallback = model.defaultScene >= 0 ? std::size_t(model.defaultScene) : 0;
    const tinygltf::Scene& scene =
        model.scenes[context.options.scene_index.value_or(std::uint32_t(fallback))];
    out.name = scene.name;
    for (const int root : scene.nodes) {
      const std::uint32_t at = place[std::size_t(root)];
      if (chosen[at]) context.warnings.add("a root node is listed twice in the scene: it is placed once");
      if (out.nodes[at].parent != kInvalidId)
        context.warnings.add("a root node of the scene has a parent, whose transform applies too");
      chosen[at] = true;
    }
    for (std::size_t i = 0; i < out.nodes.size(); ++i)
      if (out.nodes[i].parent != kInvalidId && chosen[out.nodes[i].parent]) chosen[i] = true;
  }
  std::vector<bool> by_file(place.size());
  for (std::size_t i = 0; i < place.size(); ++i) by_file[i] = chosen[place[i]];
  return by_file;
}

}  // namespace

std::vector<std::uint32_t> import_nodes(ImportContext& context, scene::SceneData& out) {
  const tinygltf::Model& model = context.storage.model();
  std::vector<std::uint32_t> place = add_nodes(model, out);
  const std::vector<Affine> worlds = make_worlds(out);
  const std::vector<bool> chosen = choose_nodes(context, place, out);
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    if (!chosen[i]) continue;
    const PlacedNode node{model.nodes[i], std::uint32_t(i), place[i], worlds[place[i]]};
    add_instances(context, node, out);
    add_camera(context, node, out);
    add_light(context, node, out);
  }
  return place;
}

}  // namespace gridcast::io
