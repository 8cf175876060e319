#include <array>
#include <string>

#include "core/io/gltf_check.h"

namespace gridcast::io {
namespace {

void check_sampler(const Cursor& sampler, std::size_t accessors) {
  (void)sampler.require("input").index(accessors);
  (void)sampler.require("output").index(accessors);
  const auto interpolation = sampler.find("interpolation");
  if (!interpolation) return;
  interpolation->expect_string();
  const Json& name = interpolation->json();
  if (name != "LINEAR" && name != "STEP" && name != "CUBICSPLINE")
    interpolation->refuse_here("must be LINEAR, STEP or CUBICSPLINE");
}

void check_channel(const Cursor& channel, std::size_t samplers, std::size_t nodes) {
  (void)channel.require("sampler").index(samplers);
  const Cursor target = channel.require("target");
  (void)target.index_in("node", nodes);
  target.require("path").expect_string();
  if (const auto extensions = target.find("extensions")) extensions->expect_object();
}

}  // namespace

void check_animations(const Cursor& root) {
  const auto accessors = root.find("accessors");
  const auto nodes = root.find("nodes");
  const std::size_t accessor_count = accessors ? accessors->size() : 0;
  const std::size_t node_count = nodes ? nodes->size() : 0;
  root.each_object("animations", [&](const Cursor& animation, std::size_t) {
    const std::size_t samplers = animation.require("samplers").size();
    (void)animation.require("channels").size();
    animation.each_object(
        "samplers", [&](const Cursor& sampler, std::size_t) { check_sampler(sampler, accessor_count); });
    animation.each_object("channels", [&](const Cursor& channel, std::size_t) {
      check_channel(channel, samplers, node_count);
    });
  });
}

}  // namespace gridcast::io
