#include <algorithm>
#include <cmath>
#include <optional>

#include "core/io/gltf_import.h"

namespace gridcast::io {
namespace {

std::optional<scene::AnimationPath> path_of(const std::string& name) {
  if (name == "translation") return scene::AnimationPath::kTranslation;
  if (name == "rotation") return scene::AnimationPath::kRotation;
  if (name == "scale") return scene::AnimationPath::kScale;
  if (name == "weights") return scene::AnimationPath::kWeights;
  return std::nullopt;
}

scene::Interpolation interpolation_of(const std::string& name) {
  if (name == "STEP") return scene::Interpolation::kStep;
  if (name == "CUBICSPLINE") return scene::Interpolation::kCubicSpline;
  return scene::Interpolation::kLinear;
}

std::size_t components_of(scene::AnimationPath path) {
  if (path == scene::AnimationPath::kWeights) return 1;
  return path == scene::AnimationPath::kRotation ? 4 : 3;
}

/// Outputs per key: the number of morph targets for weights, one otherwise.
std::size_t outputs_per_key(const scene::AnimationChannel& channel, const scene::SceneData& out) {
  if (channel.path != scene::AnimationPath::kWeights) return 1;
  const std::uint32_t mesh = out.nodes[channel.node].mesh_id;
  return mesh == kInvalidId ? 0 : out.deformations[mesh].morph_targets.size();
}

void check_times(const std::vector<float>& times, const std::string& where) {
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (!std::isfinite(times[i]) || times[i] < 0.F)
      refuse_invalid("key time " + std::to_string(i) + " is not a finite time", where);
    if (i > 0 && times[i] <= times[i - 1])
      refuse_invalid("key time " + std::to_string(i) + " is not after the one before it", where);
  }
}

scene::AnimationChannel read_channel(ImportContext& context, const tinygltf::AnimationSampler& sampler,
                                     scene::AnimationChannel channel, const scene::SceneData& out,
                                     const std::string& where) {
  channel.interpolation = interpolation_of(sampler.interpolation);
  channel.times_s = context.storage.floats(sampler.input, 1);
  check_times(channel.times_s, where + "/input");
  channel.values = context.storage.floats(sampler.output, components_of(channel.path));
  if (!std::ranges::all_of(channel.values, [](float v) { return std::isfinite(v); }))
    refuse_invalid("an output value is not finite", where + "/output");
  const std::size_t tangents = channel.interpolation == scene::Interpolation::kCubicSpline ? 3 : 1;
  const std::size_t wanted = channel.times_s.size() * tangents * outputs_per_key(channel, out);
  if (context.storage.count(sampler.output) != wanted)
    refuse_invalid("there must be " + std::to_string(wanted) + " output values for these key times",
                   where + "/output");
  return channel;
}

}  // namespace

void import_animations(ImportContext& context, const std::vector<std::uint32_t>& place,
                       scene::SceneData& out) {
  const auto& animations = context.storage.model().animations;
  for (std::size_t a = 0; a < animations.size(); ++a) {
    const tinygltf::Animation& source = animations[a];
    scene::Animation animation;
    animation.name = source.name;
    for (const tinygltf::AnimationChannel& target : source.channels) {
      const std::string where = pointer("animations", a) + "/samplers/" + std::to_string(target.sampler);
      const auto path = path_of(target.target_path);
      if (!path) {
        context.warnings.add(where + ": a channel for '" + target.target_path.substr(0, 64) + "' is skipped");
        continue;
      }
      scene::AnimationChannel channel;
      channel.node = place[std::size_t(target.target_node)];
      channel.path = *path;
      if (*path == scene::AnimationPath::kWeights && outputs_per_key(channel, out) == 0) {
        context.warnings.add(where + ": weights of a node without morph targets are skipped");
        continue;
      }
      animation.channels.push_back(read_channel(context, source.samplers[std::size_t(target.sampler)],
                                                std::move(channel), out, where));
    }
    out.animations.push_back(std::move(animation));
  }
}

}  // namespace gridcast::io
