#include "proto/render_request.h"

#include <algorithm>
#include <array>

#include "proto/instance_mask.h"
#include "proto/json_reader.h"
#include "proto/media_type.h"
#include "proto/vocabulary.h"

namespace gridcast::proto {
namespace {

LookAtCamera read_look_at(const JsonNode& node) {
  LookAtCamera camera;
  const ObjectReader object(node, {"eye", "target", "up", "yfov_deg"});
  if (node.problems->any()) return camera;
  if (const JsonNode* eye = object.require("eye")) camera.eye = read_vec3(*eye);
  if (const JsonNode* target = object.require("target")) camera.target = read_vec3(*target);
  if (const JsonNode* up = object.find("up")) camera.up = read_vec3(*up);
  if (const JsonNode* yfov = object.find("yfov_deg")) {
    camera.yfov_deg = read_number_above(*yfov, 0.0, 180.0);
    if (camera.yfov_deg == 180.0) yfov->fail(ProblemCode::kOutOfRange, "must be below 180");
  }
  return camera;
}

/// "auto", the index of a camera of the file, or a place and a target.
CameraChoice read_camera(const JsonNode& node) {
  if (node.value.is_object()) return read_look_at(node);
  if (node.value.is_number()) return FileCamera{read_id(node)};
  constexpr std::array<std::string_view, 1> kNames{"auto"};
  if (node.value.is_string())
    (void)read_choice(node, kNames);
  else
    node.fail(ProblemCode::kWrongType, "must be \"auto\", the index of a camera or an object");
  return AutoCamera{};
}

std::vector<std::string> read_layers(const JsonNode& node) {
  std::vector<std::string> layers;
  const auto array = read_array(node);
  if (!array) return layers;
  for (const simdjson::dom::element element : *array) {
    const JsonNode child = node.child(element, layers.size());
    const std::string layer = read_choice(child, kLayerNames);
    if (std::find(layers.begin(), layers.end(), layer) != layers.end())
      child.fail(ProblemCode::kDuplicateId, "this layer is named twice");
    if (node.problems->any()) break;
    layers.push_back(layer);
  }
  return layers;
}

int read_count(const ObjectReader& object, std::string_view name, int low, int high, int fallback) {
  const JsonNode* node = object.find(name);
  return node == nullptr ? fallback : int(read_integer(*node, std::uint64_t(low), std::uint64_t(high)));
}

void read_settings(const ObjectReader& object, const Limits& limits, RenderRequest& request) {
  if (const JsonNode* camera = object.find("camera")) request.camera = read_camera(*camera);
  request.width_px = read_count(object, "width_px", 1, limits.image_side_px, request.width_px);
  request.height_px = read_count(object, "height_px", 1, limits.image_side_px, request.height_px);
  request.samples = read_count(object, "samples", 1, limits.samples_per_pixel, request.samples);
  request.max_depth = read_count(object, "max_depth", 0, limits.bounce_depth, request.max_depth);
  if (const JsonNode* node = object.find("integrator"))
    request.integrator = read_choice(*node, kIntegratorNames);
  if (const JsonNode* node = object.find("layers")) request.layers = read_layers(*node);
  if (const JsonNode* node = object.find("precision"))
    request.precision = to_precision(read_choice(*node, kPrecisionNames));
  if (const JsonNode* node = object.find("deadline_ms"))
    request.deadline_ms = read_number_above(*node, 0.0, limits.deadline_ms);
  if (const auto* node = object.find("mask")) request.mask = read_query_mask(*node);
}

/// Checks that span several members.
void check_whole(const JsonNode& root, const ObjectReader& object, const Limits& limits,
                 const RenderRequest& request) {
  const auto work =
      std::uint64_t(request.width_px) * std::uint64_t(request.height_px) * std::uint64_t(request.samples);
  if (work > limits.image_samples) {
    const JsonNode* samples = object.find("samples");
    (samples != nullptr ? *samples : root)
        .fail(ProblemCode::kOutOfRange,
              "width_px * height_px * samples may be at most " + std::to_string(limits.image_samples));
  }
  if (request.format == ImageFormat::kPng && !request.layers.empty())
    object.find("layers")->fail(ProblemCode::kOutOfRange, "a PNG has one layer; ask for exr");
}

/// The format that both the body and the Accept header agree on; nothing when there is none.
std::optional<ImageFormat> choose_format(const JsonNode* node, std::string_view accept) {
  std::vector<ImageFormat> wanted{ImageFormat::kPng, ImageFormat::kExr};
  if (node != nullptr)
    wanted = {read_choice(*node, kImageFormatNames) == "exr" ? ImageFormat::kExr : ImageFormat::kPng};
  std::vector<std::string_view> offered;
  offered.reserve(wanted.size());
  for (const ImageFormat format : wanted) offered.push_back(media_type(format));
  const auto chosen = negotiate(accept, offered);
  if (!chosen) return std::nullopt;
  return wanted[*chosen];
}

}  // namespace

std::string_view media_type(ImageFormat format) {
  return format == ImageFormat::kExr ? kExrMediaType : kPngMediaType;
}

Parsed<RenderRequest> parse_render_request(std::string_view body, std::string_view accept,
                                           const Limits& limits) {
  const auto document = JsonDocument::parse(body, limits.json_bytes, limits.json_depth);
  if (!document) return document.problem();
  JsonProblems problems;
  const JsonNode root = document.value().root(problems);
  const ObjectReader object(root, {"camera", "width_px", "height_px", "integrator", "layers", "samples",
                                   "max_depth", "precision", "format", "deadline_ms", "mask"});
  RenderRequest request;
  if (!problems.any()) read_settings(object, limits, request);
  const auto format =
      problems.any() ? std::optional(ImageFormat::kPng) : choose_format(object.find("format"), accept);
  if (problems.any()) return problems.first();
  if (!format) return Problem{ProblemCode::kNotAcceptable, "pictures are image/png or image/x-exr", "Accept"};
  request.format = *format;
  check_whole(root, object, limits, request);
  if (problems.any()) return problems.first();
  return request;
}

}  // namespace gridcast::proto
