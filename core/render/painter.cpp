#include "core/render/painter.h"

#include <algorithm>
#include <string>

#include "core/render/camera.h"
#include "core/render/sampling.h"

namespace gridcast::render {
namespace {

/// Primary rays traced and shaded at once, and between two looks at the stop token.
constexpr std::size_t kRun = std::size_t(kTileSidePx) * kTileSidePx;

/// Pixels are taken in squares of this side: the sixteen rays of a packet are closest so.
constexpr int kSquarePx = 4;

LayerKind own_layer(Integrator integrator) {
  switch (integrator) {
    case Integrator::kDepth:
      return LayerKind::kDepth;
    case Integrator::kNormal:
      return LayerKind::kNormal;
    case Integrator::kId:
      return LayerKind::kInstanceId;
    case Integrator::kWhitted:
      break;
  }
  return LayerKind::kColor;
}

std::vector<LayerKind> wanted_layers(const RenderSettings& settings) {
  std::vector<LayerKind> kinds{own_layer(settings.integrator)};
  for (const LayerKind kind : settings.layers)
    if (std::find(kinds.begin(), kinds.end(), kind) == kinds.end()) kinds.push_back(kind);
  return kinds;
}

Layer make_layer(LayerKind kind, std::size_t pixels) {
  Layer layer{std::string(to_string(kind)), {}, {}, {}};
  if (kind == LayerKind::kColor) layer.channels = {"R", "G", "B", "A"};
  if (kind == LayerKind::kDepth) layer.channels = {"Z"};
  if (kind == LayerKind::kNormal) layer.channels = {"X", "Y", "Z"};
  if (layer.channels.empty()) {
    layer.channels = {"id"};
    layer.ids.resize(pixels);
  } else {
    layer.values.resize(pixels * layer.channels.size());
  }
  return layer;
}

void write(LayerKind kind, Layer& layer, std::size_t pixel, const SurfaceHit& hit, const glm::vec4& color) {
  float* values = layer.values.empty() ? nullptr : &layer.values[pixel * layer.channels.size()];
  switch (kind) {
    case LayerKind::kColor:
      std::copy_n(&color[0], 4, values);
      break;
    case LayerKind::kDepth:
      *values = float(hit.t);
      break;
    case LayerKind::kNormal:
      for (int axis = 0; axis < 3; ++axis) values[axis] = float(hit.normal[axis]);
      break;
    case LayerKind::kInstanceId:
      layer.ids[pixel] = hit.instance_id;
      break;
    case LayerKind::kMeshId:
      layer.ids[pixel] = hit.mesh_id;
      break;
    case LayerKind::kPrimitiveId:
      layer.ids[pixel] = hit.primitive_id;
      break;
  }
}

}  // namespace

Painter::Painter(const scene::Scene& scene, const RenderSettings& settings, const Lighting& lighting,
                 Film& film)
    : settings_(settings),
      film_(film),
      kinds_(wanted_layers(settings)),
      whitted_(scene, lighting, settings, settings.max_depth) {
  for (const LayerKind kind : kinds_) {
    film_.layers.push_back(make_layer(kind, std::size_t(film.width_px) * std::size_t(film.height_px)));
    (kind == LayerKind::kColor ? has_color_ : has_exact_) = true;
  }
}

Ray Painter::ray_through(double x, double y) const {
  return primary_ray(settings_.camera, film_.width_px, film_.height_px, x, y);
}

void Painter::choose_pixels(int left, int top, TileScratch& scratch) const {
  scratch.pixels.clear();
  const int right = std::min(left + kTileSidePx, film_.width_px);
  const int bottom = std::min(top + kTileSidePx, film_.height_px);
  for (int y = top; y < bottom; y += kSquarePx)
    for (int x = left; x < right; x += kSquarePx)
      for (int j = y; j < std::min(y + kSquarePx, bottom); ++j)
        for (int i = x; i < std::min(x + kSquarePx, right); ++i) scratch.pixels.push_back({i, j});
}

void Painter::paint_exact(TileScratch& scratch) const {
  scratch.rays.clear();
  for (const auto& [x, y] : scratch.pixels) scratch.rays.push_back(ray_through(x + 0.5, y + 0.5));
  scratch.hits.resize(scratch.rays.size());
  scratch.tracer.intersect(scratch.rays, {}, scratch.hits);
}

void Painter::shade_run(TileScratch& scratch) const {
  scratch.hits.resize(scratch.rays.size());
  scratch.colors.resize(scratch.rays.size());
  scratch.tracer.intersect(scratch.rays, {}, scratch.hits);
  whitted_.radiance(scratch.rays, scratch.hits, scratch.tracer, scratch.shading, scratch.colors);
  for (std::size_t i = 0; i < scratch.rays.size(); ++i) {
    scratch.sums[scratch.pixel_of[i]] += Vec3d(scratch.colors[i]);
    scratch.covered[scratch.pixel_of[i]] += int(scratch.hits[i].status == RayStatus::kHit);
  }
  scratch.rays.clear();
  scratch.pixel_of.clear();
}

bool Painter::paint_color(const std::stop_token& stop, TileScratch& scratch) const {
  scratch.sums.assign(scratch.pixels.size(), Vec3d(0.0));
  scratch.covered.assign(scratch.pixels.size(), 0);
  scratch.rays.clear();
  scratch.pixel_of.clear();
  for (std::size_t p = 0; p < scratch.pixels.size(); ++p) {
    const auto [x, y] = scratch.pixels[p];
    for (int sample = 0; sample < settings_.samples; ++sample) {
      const glm::dvec2 offset = pixel_sample(std::uint32_t(x), std::uint32_t(y), std::uint32_t(sample),
                                             std::uint32_t(settings_.samples));
      scratch.rays.push_back(ray_through(x + offset.x, y + offset.y));
      scratch.pixel_of.push_back(p);
      if (scratch.rays.size() < kRun) continue;
      if (stop.stop_requested()) return false;
      shade_run(scratch);
    }
  }
  shade_run(scratch);
  return true;
}

bool Painter::paint(int left, int top, const std::stop_token& stop, TileScratch& scratch) const {
  if (stop.stop_requested()) return false;
  choose_pixels(left, top, scratch);
  if (has_color_ && !paint_color(stop, scratch)) return false;
  if (has_exact_) paint_exact(scratch);
  for (std::size_t p = 0; p < scratch.pixels.size(); ++p) {
    const auto [x, y] = scratch.pixels[p];
    const std::size_t pixel = std::size_t(y) * std::size_t(film_.width_px) + std::size_t(x);
    const SurfaceHit hit = has_exact_ ? scratch.hits[p] : SurfaceHit{};
    glm::vec4 color(0.F);
    if (has_color_) {
      color = {Vec3f(scratch.sums[p] / double(settings_.samples)),
               float(scratch.covered[p]) / float(settings_.samples)};
    }
    for (std::size_t i = 0; i < kinds_.size(); ++i) write(kinds_[i], film_.layers[i], pixel, hit, color);
  }
  return true;
}

}  // namespace gridcast::render
