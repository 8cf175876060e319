#include <array>
#include <string>

#include "core/render/render.h"

namespace gridcast::render {
namespace {

// In the order of the enumerators.
constexpr std::array<std::string_view, 4> kIntegrators{"whitted", "depth", "normal", "id"};
constexpr std::array<std::string_view, 6> kLayers{"color",       "depth",   "normal",
                                                  "instance_id", "mesh_id", "primitive_id"};

template <class Enum, std::size_t kCount>
Result<Enum> parse(std::string_view name, const std::array<std::string_view, kCount>& names,
                   const std::string& what) {
  std::string known;
  for (std::size_t i = 0; i < kCount; ++i) {
    if (names[i] == name) return Enum(i);
    known += (i == 0 ? "" : ", ") + std::string(names[i]);
  }
  return Error{ErrorCode::kInvalidArgument, "unknown " + what + "; known are " + known, ""};
}

}  // namespace

std::string_view to_string(Integrator integrator) {
  return kIntegrators[std::size_t(integrator)];
}
Result<Integrator> parse_integrator(std::string_view name) {
  return parse<Integrator>(name, kIntegrators, "integrator");
}
std::string_view to_string(LayerKind layer) {
  return kLayers[std::size_t(layer)];
}
Result<LayerKind> parse_layer(std::string_view name) {
  return parse<LayerKind>(name, kLayers, "layer");
}

}  // namespace gridcast::render
