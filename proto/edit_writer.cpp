#include "proto/edit_writer.h"

#include "proto/replies_json.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

/// `[v,v,...]`, each written by `write(value)`.
template <class List, class Write>
void write_array(JsonText& text, const List& list, const Write& write) {
  text.raw("[");
  const char* before = "";
  for (const auto& value : list) {
    text.raw(before);
    write(value);
    before = ",";
  }
  text.raw("]");
}

/// One object, member after member.
class ObjectText {
 public:
  explicit ObjectText(JsonText& text) : text_(text) {}

  void string(std::string_view name, std::string_view value) {
    key(name);
    // Quotes, backslashes and control characters are escaped.
    text_.raw(dump_json(std::string(value)));
  }
  /// Nothing where it is the default.
  void choice(std::string_view name, std::string_view value, std::string_view fallback) {
    if (value != fallback) string(name, value);
  }
  template <class T>
  void number(std::string_view name, T value) {
    key(name);
    text_.number(value);
  }
  template <class List>
  void numbers(std::string_view name, const List& list) {
    this->list(name, list, [this](auto value) { text_.number(value); });
  }
  void vector(std::string_view name, const Vec3d& v) { numbers(name, std::array{v.x, v.y, v.z}); }
  void transform(std::string_view name, const Affine& transform) {
    key(name);
    rows(transform);
  }
  void transforms(std::string_view name, const std::vector<Affine>& transforms) {
    list(name, transforms, [this](const Affine& transform) { rows(transform); });
  }
  void positions(std::string_view name, const std::vector<Vec3f>& positions) {
    list(name, positions, [this](const Vec3f& p) {
      write_array(text_, std::array{p.x, p.y, p.z}, [this](float c) { text_.narrowed(c); });
    });
  }
  /// An animation, skin or node, by its number or its name.
  void element(std::string_view by_id, std::string_view by_name, const FileElement& element) {
    if (const auto* id = std::get_if<std::uint32_t>(&element)) return number(by_id, *id);
    string(by_name, std::get<std::string>(element));
  }
  /// Objects, whose members `write(object, value)` adds; nothing for an empty list.
  template <class List, class Write>
  void objects(std::string_view name, const List& values, const Write& write) {
    if (values.empty()) return;
    list(name, values, [&](const auto& value) {
      ObjectText object(text_);
      write(object, value);
      object.close();
    });
  }
  void close() { text_.raw("}"); }

 private:
  void key(std::string_view name) {
    text_.raw(is_empty_ ? "{\"" : ",\"");
    text_.raw(name);
    text_.raw("\":");
    is_empty_ = false;
  }
  template <class List, class Write>
  void list(std::string_view name, const List& values, const Write& write) {
    key(name);
    write_array(text_, values, write);
  }
  void rows(const Affine& m) {
    write_array(text_, std::array{0, 1, 2}, [&](int r) {
      const std::array row{m.linear[0][r], m.linear[1][r], m.linear[2][r], m.translation[r]};
      write_array(text_, row, [this](double value) { text_.number(value); });
    });
  }

  JsonText& text_;
  bool is_empty_ = true;
};

void write_node(ObjectText& object, const PoseNode& node) {
  object.element("node_id", "node", node.node);
  if (node.transform) object.transform("transform", *node.transform);
  if (node.translation) object.vector("translation", *node.translation);
  if (node.rotation) object.numbers("rotation", *node.rotation);
  if (node.scale) object.vector("scale", *node.scale);
}

void write_weights(ObjectText& object, const PoseWeights& mesh) {
  object.number("mesh_id", mesh.mesh_id);
  object.numbers("weights", mesh.weights);
}

void write_pose(ObjectText& object, const PoseRequest& pose) {
  const PoseRequest defaults;
  object.choice("base", pose.base, defaults.base);
  if (const auto& moment = pose.animation) {
    object.element("animation_id", "animation", moment->animation);
    object.number("time_s", moment->time_s);
    object.choice("wrap", moment->wrap, PoseAnimation{}.wrap);
  }
  object.objects("nodes", pose.nodes, write_node);
  object.objects("skins", pose.skins, [](ObjectText& of_skin, const PoseSkin& skin) {
    of_skin.element("skin_id", "skin", skin.skin);
    of_skin.transforms("joint_matrices", skin.joint_matrices);
  });
  object.objects("weights", pose.weights, write_weights);
}

/// Writes the members of an edit behind its `op`.
struct EditMembers {
  ObjectText& object;

  void operator()(const AddInstanceRequest& edit) const {
    object.number("mesh_id", edit.mesh_id);
    object.transform("transform", edit.world_from_object);
    if (!edit.name.empty()) object.string("name", edit.name);
    if (edit.mask != kFullMask) object.number("mask", std::uint32_t(edit.mask));
  }
  void operator()(const InstanceMove& edit) const {
    object.number("instance_id", edit.instance_id);
    object.transform("transform", edit.world_from_object);
  }
  void operator()(const InstanceChange& edit) const {
    object.number("instance_id", edit.instance_id);
    if (edit.change.world_from_object) object.transform("transform", *edit.change.world_from_object);
    if (edit.change.mask) object.number("mask", std::uint32_t(*edit.change.mask));
    if (edit.change.name) object.string("name", *edit.change.name);
  }
  void operator()(const RemoveInstanceRequest& edit) const { object.number("instance_id", edit.instance_id); }
  void operator()(const MeshVerticesRequest& edit) const {
    const VertexRequest& vertices = edit.vertices;
    object.number("mesh_id", edit.mesh_id);
    object.positions("positions", vertices.positions);
    if (!vertices.vertex_ids.empty()) object.numbers("vertex_ids", vertices.vertex_ids);
    object.choice("update", vertices.update, VertexRequest{}.update);
  }
  void operator()(const PoseEditRequest& edit) const {
    if (edit.op == kEditNames[4])
      write_pose(object, edit.pose);
    else
      write_weights(object, edit.pose.weights.at(0));
    object.choice("update", edit.pose.update, PoseRequest{}.update);
  }
};

struct OpName {
  std::string_view operator()(const AddInstanceRequest& /*edit*/) const { return kEditNames[0]; }
  std::string_view operator()(const InstanceMove& /*edit*/) const { return kEditNames[1]; }
  std::string_view operator()(const RemoveInstanceRequest& /*edit*/) const { return kEditNames[2]; }
  std::string_view operator()(const MeshVerticesRequest& /*edit*/) const { return kEditNames[3]; }
  std::string_view operator()(const PoseEditRequest& edit) const { return edit.op; }
  std::string_view operator()(const InstanceChange& /*edit*/) const { return kEditNames[6]; }
};

}  // namespace

void write_edit(JsonText& text, const TransactionEdit& edit) {
  ObjectText object(text);
  object.string("op", std::visit(OpName{}, edit));
  std::visit(EditMembers{object}, edit);
  object.close();
}

}  // namespace gridcast::proto
