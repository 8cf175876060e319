#include "core/scene/next_pose.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <unordered_set>

#include "core/scene/animation.h"

namespace gridcast::scene {
namespace {

/// Names listed in an error, and bytes of each.
constexpr std::size_t kMaxListed = 100, kMaxNameBytes = 64;

Error invalid(std::string message, std::string where) {
  return {ErrorCode::kInvalidArgument, std::move(message), std::move(where)};
}

std::string at(std::string list, std::size_t index) {
  return std::move(list.append("/")).append(std::to_string(index));
}

/// "; there are Survey, Walk, Run", or that there is none.
template <class Elements>
std::string known_names(const Elements& elements) {
  if (elements.empty()) return "; the file has none";
  std::string text = "; there are";
  for (std::size_t i = 0; i < elements.size() && i < kMaxListed; ++i) {
    const std::string& name = elements[i].name;
    text.append(i == 0 ? " " : ", ");
    text.append(name.empty() ? std::to_string(i) : name.substr(0, kMaxNameBytes));
  }
  if (elements.size() > kMaxListed) text += " and " + std::to_string(elements.size() - kMaxListed) + " more";
  return text;
}

Error not_found(const char* kind, const std::string& known, std::string where) {
  return {ErrorCode::kNotFound, std::string("there is no such ") + kind + known, std::move(where)};
}

Error ambiguous(const char* kind, std::string where) {
  return invalid(std::string("more than one ") + kind + " has this name: use its number", std::move(where));
}

/// The animation or skin that is meant; `kind` is what it is called, and the member that names it.
template <class Elements>
Result<std::uint32_t> find(const Elements& elements, const ElementRef& ref, const char* kind,
                           const std::string& where) {
  const std::string member = where + "/" + kind;
  if (const auto* id = std::get_if<std::uint32_t>(&ref)) {
    if (*id < elements.size()) return *id;
    return not_found(kind, known_names(elements), member + "_id");
  }
  const auto named = [&](const auto& element) { return element.name == std::get<std::string>(ref); };
  const auto found = std::ranges::find_if(elements, named);
  if (found == elements.end()) return not_found(kind, known_names(elements), member);
  if (std::find_if(found + 1, elements.end(), named) != elements.end()) return ambiguous(kind, member);
  return std::uint32_t(found - elements.begin());
}

/// Nodes by name, made when the first name is asked for.
class NodeFinder {
 public:
  NodeFinder(const SceneData& data, const Rig& rig) : data_(data), rig_(rig) {}

  Result<std::uint32_t> operator()(const ElementRef& ref, const std::string& where) {
    if (const auto* id = std::get_if<std::uint32_t>(&ref)) {
      const auto found = rig_.node_of_id.find(*id);
      if (found != rig_.node_of_id.end()) return found->second;
      return not_found("node", "", where + "/node_id");
    }
    if (by_name_.empty()) index_names();
    const auto found = by_name_.find(std::get<std::string>(ref));
    if (found == by_name_.end()) return not_found("node", "", where + "/node");
    if (found->second == kInvalidId) return ambiguous("node", where + "/node");
    return found->second;
  }

 private:
  void index_names() {
    for (std::uint32_t n = 0; n < data_.nodes.size(); ++n) {
      const auto [entry, is_new] = by_name_.emplace(data_.nodes[n].name, n);
      if (!is_new) entry->second = kInvalidId;
    }
  }

  const SceneData& data_;
  const Rig& rig_;
  std::unordered_map<std::string_view, std::uint32_t> by_name_;  ///< kInvalidId: several have it
};

double moment_of(const Animation& animation, const AnimationTime& time) {
  const double duration = duration_s(animation);
  if (time.wrap == AnimationWrap::kClamp) return std::clamp(time.time_s, 0.0, duration);
  if (!(duration > 0.0)) return 0.0;
  const double rest = std::fmod(time.time_s, duration);
  return rest < 0.0 ? rest + duration : rest;
}

/// Applies the parts of an edit one after the other to a pose.
class PoseMaker {
 public:
  PoseMaker(const SceneData& data, const Rig& rig, const Pose& present, const SetPose& edit)
      : data_(data),
        rig_(rig),
        edit_(edit),
        pose_(edit.base == PoseBase::kRest ? rest_pose(data, rig) : present) {}

  Result<Pose> run() {
    if (edit_.animation || !edit_.nodes.empty()) {
      nodes_ = std::make_shared<NodePoses>(*pose_.nodes);
      if (Status status = animate(); !status) return status.error();
      if (Status status = move_nodes(); !status) return status.error();
      place_nodes(data_, *nodes_);
      if (!std::ranges::all_of(nodes_->worlds, [](const Affine& world) { return is_finite(world); }))
        return invalid("a node leaves the range of double", edit_.nodes.empty() ? "/animation" : "/nodes");
      pose_.nodes = std::move(nodes_);
    }
    if (Status status = move_joints(); !status) return status.error();
    if (Status status = weigh(); !status) return status.error();
    return std::move(pose_);
  }

 private:
  Status animate() {
    if (!edit_.animation) return ok_status();
    const auto id = find(data_.animations, edit_.animation->animation, "animation", "");
    if (!id) return id.error();
    if (!std::isfinite(edit_.animation->time_s)) return invalid("the time is not finite", "/time_s");
    const Animation& animation = data_.animations[*id];
    pose_.animation = AnimationMoment{*id, moment_of(animation, *edit_.animation)};
    for (const AnimationChannel& channel : animation.channels) apply(channel, pose_.animation->time_s);
    return ok_status();
  }

  void apply(const AnimationChannel& channel, double time_s) {
    if (channel.times_s.empty()) return;
    if (channel.path == AnimationPath::kWeights) {
      const auto mesh = rig_.mesh_of_node.find(channel.node);
      if (mesh == rig_.mesh_of_node.end()) return;
      std::vector<double>& weights = pose_.weights.at(mesh->second);
      if (weights.size() == component_count(channel)) sample(channel, time_s, weights);
      return;
    }
    Trs& parts = nodes_->parts[channel.node];
    std::array<double, 4> value{};
    sample(channel, time_s, std::span(value).first(component_count(channel)));
    if (channel.path == AnimationPath::kRotation) parts.rotation = value;
    Vec3d& vector = channel.path == AnimationPath::kScale ? parts.scale : parts.translation;
    if (channel.path != AnimationPath::kRotation) vector = {value[0], value[1], value[2]};
    nodes_->locals[channel.node] = affine_from_trs(parts);
  }

  Status move_nodes() {
    NodeFinder find_node(data_, rig_);
    std::unordered_set<std::uint32_t> moved;
    for (std::size_t i = 0; i < edit_.nodes.size(); ++i) {
      const std::string where = at("/nodes", i);
      const auto node = find_node(edit_.nodes[i].node, where);
      if (!node) return node.error();
      if (!moved.insert(*node).second) return invalid("this node is given twice", where);
      if (Status status = move(*node, edit_.nodes[i], where); !status) return status;
    }
    return ok_status();
  }

  Status move(std::uint32_t node, const NodeTransform& to, const std::string& where) {
    const auto* whole = std::get_if<Affine>(&to.parent_from_node);
    Trs& parts = nodes_->parts[node];
    if (whole == nullptr) {
      const TrsParts& given = std::get<TrsParts>(to.parent_from_node);
      if (given.rotation && *given.rotation == std::array<double, 4>{})
        return invalid("a rotation must not be zero", where + "/rotation");
      parts.translation = given.translation.value_or(parts.translation);
      parts.rotation = given.rotation.value_or(parts.rotation);
      parts.scale = given.scale.value_or(parts.scale);
    }
    const Affine local = whole == nullptr ? affine_from_trs(parts) : *whole;
    if (!InstanceTransform(local).active())
      return invalid("the transform is singular, not finite or out of range",
                     where + (whole == nullptr ? "" : "/transform"));
    nodes_->locals[node] = local;
    if (whole != nullptr) parts = trs_from_affine(local);
    return ok_status();
  }

  Status move_joints() {
    std::unordered_set<std::uint32_t> moved;
    for (std::size_t i = 0; i < edit_.skins.size(); ++i) {
      const std::string where = at("/skins", i);
      const auto skin = find(data_.skins, edit_.skins[i].skin, "skin", where);
      if (!skin) return skin.error();
      if (!moved.insert(*skin).second) return invalid("this skin is given twice", where);
      const std::vector<Affine>& matrices = edit_.skins[i].joint_matrices;
      const std::size_t count = data_.skins[*skin].joints.size();
      const std::string list = where + "/joint_matrices";
      if (matrices.size() != count)
        return invalid("the skin has " + std::to_string(count) + " joints, got " +
                           std::to_string(matrices.size()) + " matrices",
                       list);
      for (std::size_t j = 0; j < count; ++j)
        if (!InstanceTransform(matrices[j]).active())
          return invalid("the matrix is singular, not finite or out of range", at(list, j));
      pose_.joints[*skin] = matrices;
    }
    return ok_status();
  }

  Status weigh() {
    std::unordered_set<std::uint32_t> weighed;
    for (std::size_t i = 0; i < edit_.weights.size(); ++i) {
      const auto& [mesh_id, weights] = edit_.weights[i];
      const std::string where = at("/weights", i);
      const auto present = pose_.weights.find(mesh_id);
      if (present == pose_.weights.end())
        return invalid("there is no mesh of this number with morph targets", where + "/mesh_id");
      if (!weighed.insert(mesh_id).second) return invalid("this mesh is given twice", where + "/mesh_id");
      if (weights.size() != present->second.size())
        return invalid("the mesh has " + std::to_string(present->second.size()) + " morph targets, got " +
                           std::to_string(weights.size()) + " weights",
                       where + "/weights");
      for (std::size_t t = 0; t < weights.size(); ++t)
        if (!std::isfinite(weights[t])) return invalid("the weight is not finite", at(where + "/weights", t));
      present->second = weights;
    }
    return ok_status();
  }

  const SceneData& data_;
  const Rig& rig_;
  const SetPose& edit_;
  Pose pose_;
  std::shared_ptr<NodePoses> nodes_;  ///< while they change
};

}  // namespace

Result<Pose> next_pose(const SceneData& data, const Rig& rig, const Pose& present, const SetPose& edit) {
  return PoseMaker(data, rig, present, edit).run();
}

}  // namespace gridcast::scene
